"""The directory of a result: one owner, one verdict.

A command takes it (`owned`), which locks it; retires what is there (`begin`), from which on it is
that of an unfinished result; and marks the set that it has written (`complete`) by a manifest with
the digest of every file, written last. Whoever reads one asks for its `standing`, or, where only a
complete one will do, why it is `not_whole`.
"""

from __future__ import annotations

from .lock import LOCK, holders
from .manifest import MANIFEST
from .names import KINDS, kind_of
from .ownership import BUSY, OCCUPIED, Ownership, busy_faults, owned
from .standing import Standing, not_whole, occupied, seal_of, standing
from .unfinished import UNFINISHED

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
