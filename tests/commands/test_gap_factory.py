"""Batches as a works has them: Q-DAS files, Parquet, tables without a column of units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.data import GapData
from tolevo.commands.gap.read import read_data
from tolevo.models.measurable import Role

VALUES = np.random.default_rng(1).normal(0.55, 0.06, 20).round(4)
CONFIG = 'model = "rv_batch"\nparameters.model = "document"\n[columns]\nSpiel = "backlash_arcmin"\n'
HEAD = "K0100 1\nK1001 4711\nK2001 1\nK2002 Spiel\nK2142 arcmin\n"


def q_das() -> str:
    """Rows a minute apart, in two batches."""
    return HEAD + "".join(
        f"K0001 {value}\nK0004 1.3.2026/08:{at:02d}:00\nK0006 L{at // 10}\n".replace(".", ",", 1)
        for at, value in enumerate(VALUES)
    )


def read(folder: Path, name: str) -> GapData:
    (folder / "gap.toml").write_text(CONFIG, encoding="utf-8")
    if name.endswith(".dfq"):
        (folder / name).write_text(q_das(), encoding="cp1252")
    elif name.endswith(".parquet"):
        pd.DataFrame({"Spiel [arcmin]": VALUES}).to_parquet(folder / name)
    else:
        rows = "".join(f"{value}\n".replace(".", ",") for value in VALUES)
        (folder / name).write_text(f"Spiel [arcmin];Rest\n{rows}".replace("\n", ";x\n")
                                   .replace("Rest;x", "Rest"), encoding="cp1252")  # fmt: skip
    plan = read_gap(folder / "gap.toml")
    return read_data(plan, folder / name)


@pytest.mark.parametrize("name", ["b.dfq", "b.parquet", "b.csv"])
def test_every_row_is_a_unit_where_no_column_tells_them_apart(name: str, tmp_path: Path) -> None:
    data = read(tmp_path, name)
    np.testing.assert_allclose(data.measured["backlash_arcmin"], VALUES)
    assert any("each row counts as a separate unit" in note for note in data.notes)


def test_times_and_batches_of_a_q_das_file_are_known(tmp_path: Path) -> None:
    data = read(tmp_path, "b.dfq")
    table = data.measurements.table
    np.testing.assert_allclose(table["time_s"], 60.0 * np.arange(20))
    assert list(data.measurements[Role.LOT]) == [f"L{at // 10}" for at in range(20)]
