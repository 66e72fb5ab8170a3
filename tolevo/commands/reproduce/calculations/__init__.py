"""Calculations by which shipped claims are recomputed."""
