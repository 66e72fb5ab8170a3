"""The fronts of reducers, which do not depend on the search, stored in the directory of the run."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ...files import write_bytes
from ...problems.interfaces import Stored
from ...problems.tolerance_problem import ToleranceProblem

REDUCERS = "reducers.npz"


def store_reducer_fronts(problem: ToleranceProblem, folder: Path) -> None:
    """Read the fronts of reducers from the directory where they belong to this configuration, else
    compute and write them.
    """
    path = folder / REDUCERS
    if path.is_file():
        try:
            with np.load(path, allow_pickle=False) as stored:
                if Stored.of(problem).adopt({name: stored[name] for name in stored.files}):
                    return
        except (OSError, ValueError, KeyError):
            pass  # a file that cannot be read is written anew
    arrays = Stored.of(problem).kept()
    if arrays:
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, **arrays)
        write_bytes(path, content.getvalue())
