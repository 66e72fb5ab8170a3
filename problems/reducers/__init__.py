"""Reducers inside a larger allocation: what they cost at a mean square of their backlash."""
