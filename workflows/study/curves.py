"""The curves of a study in a Parquet file, a row group for each setting: never all in memory."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from ...algorithms.course import CURVE
from ..execution import Closing
from .trial import RunRecord

WHOLE = ("point", "replicate", "generation", "evaluations")
SCHEMA = pa.schema([(name, pa.int64() if name in WHOLE else pa.float64()) for name in ("point", "replicate", *CURVE)])


class Curves(Closing):
    """One row per checkpoint of a run: point, replicate and `CURVE`.

    The file is a temporary one, which goes with this object; `copy_to` makes a lasting one. It can
    be read once it is closed: leave it as a context.
    """

    def __init__(self) -> None:
        folder = tempfile.mkdtemp(prefix="tolevo-curves-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._path = Path(folder, "curves.parquet")
        self._group: dict[int, int] = {}
        self._writer = parquet.ParquetWriter(self._path, SCHEMA)

    def close(self) -> None:
        """Nothing more is to be added."""
        self._writer.close()

    def add(self, point: int, runs: Sequence[RunRecord]) -> None:
        """The curves of the runs of one setting."""
        if len(frame := curves_of(runs)):
            self._group[point] = len(self._group)
            table = pa.Table.from_pandas(frame, schema=SCHEMA, preserve_index=False)
            self._writer.write_table(table, row_group_size=len(frame))

    def of(self, point: int) -> pd.DataFrame:
        """The curves of the runs of one setting, empty where there are none."""
        if point not in self._group:
            return curves_of(())
        with parquet.ParquetFile(self._path) as file:
            frame: pd.DataFrame = file.read_row_group(self._group[point]).to_pandas()
        return frame

    def copy_to(self, path: Path) -> None:
        """Write the whole file."""
        shutil.copyfile(self._path, path)


def curves_of(runs: Sequence[RunRecord]) -> pd.DataFrame:
    """The frame of the curves of runs."""
    lengths = [len(run.curve) for run in runs]
    values = np.concatenate([np.empty((0, len(CURVE))), *(run.curve for run in runs)])
    identity = {name: np.repeat([getattr(run, name) for run in runs], lengths) for name in ("point", "replicate")}
    frame = pd.DataFrame(identity | dict(zip(CURVE, values.T, strict=True)))
    return frame.astype(dict.fromkeys(WHOLE, np.int64))
