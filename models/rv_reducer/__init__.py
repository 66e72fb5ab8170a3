"""The RV reducer: geometric backlash, tooth modification, and batches of units."""
