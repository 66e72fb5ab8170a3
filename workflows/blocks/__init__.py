"""A table computed block by block; the blocks are computed anywhere, and stored as they end."""

from __future__ import annotations

from .compute import BlockProgress, Computed, computed
from .folder import PART, BlockFolder, folder_faults
from .rows import ArrayRows, FrameRows, ParquetRows, Rows
from .target import Target

__all__ = [
    "PART",
    "ArrayRows",
    "BlockFolder",
    "BlockProgress",
    "Computed",
    "FrameRows",
    "ParquetRows",
    "Rows",
    "Target",
    "computed",
    "folder_faults",
]
