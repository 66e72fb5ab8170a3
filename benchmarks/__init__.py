"""Speeds and comparisons; not shipped."""
