"""Two studies of `rv_reducer`: all settings on a small sample, its leaders on the full one."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.study.study import study as write

pytestmark = pytest.mark.slow  # leaders as the design of a finer study: test_racing.py

RUN = """
problem = "rv_reducer"
[parameters]
allow_interference = true
search_units = 16
report_units = 128
elastic_units = 16
positions = 11
te_positions = 31
[variables]
involute_grade = { value = 5 }
[algorithm]
name = "nsga2"
engine = "array"
generations = 5
"""
STUDY = """
run = "rv_reducer.toml"
seeds = 12
response = ["hypervolume"]
{more}
[design]
{design}
[vary]
"algorithm.population" = [4, 8, 64]
"""
FACTORIAL, LEADERS = 'kind = "factorial"', 'kind = "table"\nfile = "coarse/leaders.csv"'
FULL = '"run.parameters.search_units" = 64'


def studied(folder: Path, name: str, design: str, more: str = "") -> pd.DataFrame:
    """The table of a study, by the command."""
    path = folder / f"{name}.toml"
    path.write_text(STUDY.format(design=design, more=more), encoding="utf-8")
    words = ["study", str(path), "--out", str(folder / name), "--quiet"]
    ended = CliRunner().invoke(app, words)
    assert ended.exit_code == 0, ended.output
    return pd.read_csv(folder / name / "study.csv")


def test_leaders_on_a_small_sample_are_run_on_the_full_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their runs are those of a study of all settings on the full sample."""
    monkeypatch.setattr(write, "figures", lambda result: ())
    (tmp_path / "rv_reducer.toml").write_text(RUN, encoding="utf-8")
    coarse = studied(tmp_path, "coarse", FACTORIAL)
    fine = studied(tmp_path, "fine", LEADERS, FULL)
    whole = studied(tmp_path, "whole", FACTORIAL, FULL)
    key = "algorithm.population"
    leaders = pd.read_csv(tmp_path / "coarse" / "leaders.csv")[key]
    assert 1 <= len(leaders) < 3
    assert leaders[0] == coarse.groupby(key)["hypervolume"].median().idxmax()
    assert list(dict.fromkeys(fine[key])) == list(leaders)
    known = whole.set_index([key, "replicate"])["hypervolume"]
    assert fine.set_index([key, "replicate"])["hypervolume"].equals(
        known.loc[[(size, at) for size in leaders for at in range(12)]]
    )
    small = coarse.set_index([key, "replicate"])["hypervolume"]
    assert not known.equals(small)
