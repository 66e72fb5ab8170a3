"""The store of a study: one row per run as soon as it ends."""
