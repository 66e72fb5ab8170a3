"""The directory of a result, which has a single owner and a single state.

A command takes it (`owned`), which locks it; retires the old result (`begin`), after which the
directory is that of an unfinished result; and marks the set of files that it has written
(`complete`) by a manifest with the digest of every file, written last. A reader asks for the
`standing` of a directory or, where a complete result is needed, why it is `not_whole`.
"""

from __future__ import annotations

from .lock import LOCK, holders
from .ownership import ASKED, BUSY, CONFIGURATION, OCCUPIED, TOLD, Ownership, busy_faults, holds_search, own_folder
from .standing import KINDS, MANIFEST, UNFINISHED, Standing, incompleteness, is_occupied, kind_of, seal_of, standing

__all__ = [
    "ASKED",
    "BUSY",
    "CONFIGURATION",
    "KINDS",
    "LOCK",
    "MANIFEST",
    "OCCUPIED",
    "TOLD",
    "UNFINISHED",
    "Ownership",
    "Standing",
    "busy_faults",
    "holders",
    "holds_search",
    "incompleteness",
    "is_occupied",
    "kind_of",
    "own_folder",
    "seal_of",
    "standing",
]
