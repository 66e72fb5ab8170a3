import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tests.small_jobs import TWO_PARTS
from tolevo.errors import InputError
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_reducer.problem import RvReducer

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


def test_the_allocation_of_a_run_is_evaluated_as_rounded(tmp_path: Path) -> None:
    """Its rows are variables; `choices.csv` of the run has the cost of the rounded values."""
    table = tomllib.loads(TWO_PARTS.replace("[requirement]", "[rounding]\nsteps = 0.02\n[requirement]"))
    run = tmp_path / "run"
    tolevo.run(table | {"objectives": {"minimise": ["cost", "variation"]}}, run)
    found = tolevo.evaluate(table, run / "allocation.csv", tmp_path / "e.csv")
    choices = pd.read_csv(run / "choices.csv").drop_duplicates("point")
    assert len(found) == len(choices) > 1
    np.testing.assert_allclose(found["cost"], choices["rounded_cost"], rtol=1e-12)
    np.testing.assert_allclose(found["a_t"] / 0.02, np.rint(found["a_t"] / 0.02), atol=1e-9)
    rows = pd.read_csv(run / "allocation.csv")
    rows.loc[1, "unit"] = "um"
    pd.concat([rows, rows.iloc[:1]]).to_csv(tmp_path / "bad.csv", index=False)
    with pytest.raises(InputError) as caught:
        tolevo.evaluate(table, tmp_path / "bad.csv", tmp_path / "out.csv")
    assert 'bad.csv: row 3: states b_t in "um", but this configuration has it in "mm"' in str(caught.value)
    assert f"bad.csv: row {len(rows) + 2}: states a_t of point {rows['point'][0]} again" in str(caught.value)


@pytest.mark.parametrize("as_frame", [False, True])
def test_variables_without_a_unit_are_evaluated_from_an_allocation(tmp_path: Path, as_frame: bool) -> None:
    problem = tolevo.read(STAGGERED).problem
    assert problem is not None
    tightest = problem.corner(tight=True)
    rows = [
        {"choice": "knee", "point": 1, "variable": variable.name, "unit": variable.unit, "rounded": value}
        for variable, value in zip(problem.variables, tightest, strict=True)
    ]
    assert "" in {row["unit"] for row in rows}
    pd.DataFrame(rows).assign(value=0.0, grade="", notation="").to_csv(tmp_path / "allocation.csv", index=False)
    table = pd.read_csv(tmp_path / "allocation.csv") if as_frame else tmp_path / "allocation.csv"
    found = tolevo.evaluate(STAGGERED, table)
    assert len(found) == 1
    np.testing.assert_allclose(
        found["involute_grade"], problem.corner(tight=True)[problem.names.index("involute_grade")]
    )


def test_a_column_in_another_unit_by_its_name_is_converted(tmp_path: Path) -> None:
    """`pitch_mm` was to be renamed to `pitch_um`, by a factor of 1000."""
    path = tmp_path / "d.csv"
    designs(pitch_um=4.0).to_csv(path, index=False)
    same = tolevo.evaluate(STAGGERED, path)
    designs(pitch_mm=0.004).drop(columns="pitch_um").to_csv(path, index=False)
    found = tolevo.evaluate(STAGGERED, path)
    np.testing.assert_allclose(found["pitch_um"], 4.0, rtol=1e-12)
    np.testing.assert_allclose(found["backlash_arcmin"], same["backlash_arcmin"], rtol=1e-9)


@pytest.mark.slow  # the contact is compiled
def test_what_compiles_the_contact_computes_the_same_as_what_loads_it(tmp_path: Path) -> None:
    document = {v.name: [0.0 if v.document is None else float(v.document)] for v in RvReducer.declaration.variables}
    pd.DataFrame(document).to_csv(tmp_path / "d.csv", index=False)
    (tmp_path / "c.toml").write_text('problem = "rv_reducer"\n', encoding="utf-8")
    evaluation = [sys.executable, "-m", "tolevo", "evaluate", "c.toml", "d.csv", "--out"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    tables = [tmp_path / "compiled.csv", tmp_path / "loaded.csv"]
    for table in tables:
        subprocess.run([*evaluation, table.name], cwd=tmp_path, env=environment, check=True)
    compiled, loaded = (table.read_text(encoding="utf-8") for table in tables)
    assert compiled == loaded
