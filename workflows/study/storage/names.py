"""Names of what a study keeps its runs in."""

from __future__ import annotations

DATABASE = "study.sqlite"
PLACE = "store.json"
"""Says that the runs are in a store that machines share, and where that is."""
CONFIGURATION = "config.toml"
