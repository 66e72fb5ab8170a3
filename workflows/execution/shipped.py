"""Objects that are sent to workers: pickled once, built once, and of the same version."""

from __future__ import annotations

import pickle
from functools import lru_cache
from importlib.metadata import version
from typing import Any

from ...errors import RunError

KEPT = 4
"""Objects that a worker keeps built."""


@lru_cache(maxsize=KEPT)
def built(content: bytes) -> Any:
    """The pickled object; the next task with the same one finds it built."""
    return pickle.loads(content)


def check_version(sent: str) -> None:
    """Raises RunError where a worker has another version of the package than the sender."""
    installed = version("tolevo")
    if sent != installed:
        raise RunError(f"a worker has tolevo {installed}, this is {sent}: install the same everywhere")
