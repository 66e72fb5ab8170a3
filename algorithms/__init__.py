"""Optimisers through pymoo, the search loop, and indicators."""
