"""The files of a result directory, read with a remark for everything that is wrong with them."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...csv_text import read_own_csv
from ...directory import KINDS, MANIFEST, standing
from ...directory.names import fits
from .unfinished import remark_of

TEXT = ("violated_limits", "rounded_violated_limits", "grade", "unit", "meaning")
"""Columns of text that may be empty."""
SHOWN = 3
"""Bad cells of a column that are named; the rest is counted."""


class Stored:
    """A directory; what is missing or wrong is returned as None and noted in `remarks`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.remarks: list[str] = []
        self.standing = standing(folder)
        if text := remark_of(self.standing):
            self.remark(MANIFEST, text)

    def remark(self, name: str, text: str) -> None:
        """Add a remark on a file."""
        self.remarks.append(f"{name}: {text}")

    @property
    def unfinished(self) -> bool:
        """Whether the result is being computed, or was interrupted."""
        return self.standing.unfinished is not None

    def missing(self) -> None:
        """Remark which files of a complete result are gone, unless that has been remarked."""
        kind = KINDS.get(self.standing.command)
        remarked = {remark.split(": ")[0] for remark in self.remarks}
        for name in self.standing.missing:
            if name not in remarked and kind is not None and not fits(name, kind.state):
                self.remark(name, "is missing")

    def text(self, name: str, needed: bool = True) -> str | None:
        """The text of a file."""
        try:
            return (self.folder / name).read_text(encoding="utf-8")
        except FileNotFoundError:
            if needed:
                self.remark(name, "is missing")
        except UnicodeDecodeError:
            self.remark(name, "is not UTF-8 text")
        except OSError as error:
            self.remark(name, f"cannot be read ({error.strerror})")
        return None

    def record(self, name: str) -> dict[str, Any]:
        """The object in a JSON file, empty where there is none."""
        text = self.text(name)
        if text is None:
            return {}
        try:
            content = json.loads(text)
        except ValueError as error:
            self.remark(name, f"is not JSON ({error}): was it edited by hand?")
            return {}
        if not isinstance(content, dict):
            self.remark(name, "holds no JSON object: was it edited by hand?")
            return {}
        return content

    def table(self, name: str, numeric: Iterable[str] = (), needed: bool = True) -> pd.DataFrame | None:
        """A CSV table; rows without a finite number in a column of `numeric` are left out."""
        if self.text(name, needed) is None:
            return None
        try:
            frame = read_own_csv(self.folder / name)
        except (ValueError, OSError) as error:  # pandas' own errors are ValueErrors
            self.remark(name, f"is not a table ({str(error).strip()}): was it edited by hand?")
            return None
        blank = {column: frame[column].astype(object).fillna("") for column in TEXT if column in frame}
        return self.numbered(frame.assign(**blank), name, numeric)

    def numbered(self, frame: pd.DataFrame, name: str, numeric: Iterable[str]) -> pd.DataFrame:
        """The table without rows that lack a number where there must be one."""
        valid = np.ones(len(frame), dtype=bool)
        typed = frame.copy()
        for column in numeric:
            if column not in frame:
                continue
            values = pd.to_numeric(frame[column], errors="coerce")
            good = np.isfinite(values.to_numpy(dtype=float))
            self._bad_cells(name, column, np.flatnonzero(~good))
            typed[column] = values
            valid &= good
        return typed[valid].reset_index(drop=True)

    def _bad_cells(self, name: str, column: str, rows: np.ndarray) -> None:
        if len(rows):
            named = ", ".join(str(row + 2) for row in rows[:SHOWN])
            more = f" and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
            self.remark(name, f"line {named}{more}, column {column}: no finite number; left out")

    def edited(self, hashes: Mapping[str, Any]) -> None:
        """Remark which files are not as they were written, by their SHA-256."""
        for name, known in hashes.items():
            path = self.folder / Path(str(name)).name  # a missing file is remarked where it is read
            if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() != known:
                self.remark(path.name, "was changed after it was written; shown as it is now")

    def newer(self, name: str, versions: Any, format_: Any, known: int) -> None:
        """Remark whether a newer version wrote this."""
        written = str(versions.get("tolevo", "")) if isinstance(versions, Mapping) else ""
        of_format = isinstance(format_, int) and format_ > known
        if of_format or _parts(written) > _parts(version("tolevo")):
            self.remark(
                name,
                f"was written by a newer version ({written or 'unknown'}, format {format_}; this is "
                f"{version('tolevo')}, format {known}): what it has beyond that is not shown; update tolevo",
            )


def _parts(text: str) -> tuple[int, ...]:
    """The numbers of a version: "0.10.1" is after "0.9"."""
    match = re.match(r"\d+(\.\d+)*", text)
    return tuple(int(part) for part in match[0].split(".")) if match else ()
