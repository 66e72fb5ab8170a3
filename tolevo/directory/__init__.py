"""The directory of a result, which has a single owner and a single state.

A command takes it (`owned`), which locks it; retires the old result (`begin`), after which the
directory is that of an unfinished result; and marks the set of files that it has written
(`complete`) by a manifest with the digest of every file, written last. A reader asks for the
`standing` of a directory or, where a complete result is needed, why it is `not_whole`.
"""

from __future__ import annotations

from .lock import LOCK, holders
from .ownership import BUSY, OCCUPIED, Ownership, busy_faults
from .ownership import own_folder as owned
from .standing import KINDS, MANIFEST, UNFINISHED, Standing, kind_of, seal_of, standing
from .standing import incompleteness as not_whole
from .standing import is_occupied as occupied

__all__ = [
    "BUSY",
    "KINDS",
    "LOCK",
    "MANIFEST",
    "OCCUPIED",
    "UNFINISHED",
    "Ownership",
    "Standing",
    "busy_faults",
    "holders",
    "kind_of",
    "not_whole",
    "occupied",
    "owned",
    "seal_of",
    "standing",
]
