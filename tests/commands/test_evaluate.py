from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.errors import InputError
from tolevo.problems.rv_backlash import RvBacklash

STAGGERED = {
    "problem": "rv_backlash",
    "parameters": {"reading": "printed"},
    "variables": {"stagger_arcmin": {"value": 0.1}},
}


def designs(**changes: float) -> pd.DataFrame:
    document = {v.name: [float(v.document or 0.0)] * 2 for v in RvBacklash.declaration.variables}
    return pd.DataFrame(document).assign(**changes)


def test_fixed_column_may_be_left_out_or_given(tmp_path: Path) -> None:
    path, out = tmp_path / "d.csv", tmp_path / "out.csv"
    designs().drop(columns="stagger_arcmin").to_csv(path, index=False)
    left_out = tolevo.evaluate(STAGGERED, path, out)
    assert left_out["stagger_arcmin"].tolist() == [0.1, 0.1]
    designs(stagger_arcmin=0.0).to_csv(path, index=False)
    given = tolevo.evaluate(STAGGERED, path, out)
    assert given["stagger_arcmin"].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(given["backlash_mean_arcmin"], 0.701, atol=1e-3)  # by hand
    written = pd.read_csv(out)
    assert written["backlash_arcmin"].tolist() == given["backlash_arcmin"].tolist()


def test_every_fault_at_once_and_nothing_written(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    bad = designs(pitch_um=-1.0, involute_grade=6.5, eccentricity_um=11.0, odd=1.0)
    bad.drop(columns="runout_um").to_csv(path, index=False)
    with pytest.raises(InputError) as caught:
        tolevo.evaluate(STAGGERED, path, tmp_path / "out.csv")
    said = str(caught.value)
    assert "d.csv: column runout_um is missing" in said
    assert "odd" not in said  # what nothing needs is a note
    assert "d.csv: row 3, column pitch_um: must be at least 0 um, got -1" in said
    assert "d.csv: row 2, column involute_grade: must be a whole number, got 6.5" in said
    assert "d.csv: row 2, column eccentricity_um: must be at most 10 um, got 11" in said
    assert [file.name for file in tmp_path.iterdir()] == ["d.csv"]


def test_tolerance_of_zero_is_a_limit_of_infinite_cost(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    designs(eccentricity_um=0.0).to_csv(path, index=False)
    found = tolevo.evaluate(STAGGERED, path, tmp_path / "out.csv")
    assert np.isinf(found["cost"].iloc[-1])
    assert np.all(np.isfinite(found["backlash_arcmin"]))


def test_grade_without_a_cost_is_a_limit_too(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    designs(involute_grade=9).to_csv(path, index=False)
    assert np.isinf(tolevo.evaluate(STAGGERED, path, tmp_path / "out.csv")["cost"].iloc[-1])
