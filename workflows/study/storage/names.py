"""Names of the files in which a study stores its runs."""

from __future__ import annotations

DATABASE = "study.sqlite"
PLACE = "store.json"
"""Says that the runs are in a store that machines share, and where that is."""
CONFIGURATION = "config.toml"
