"""Every design through all statistics and onto its page, whole and with failures."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.blanks import blanks
from tolevo.commands.study.analysis import analyse
from tolevo.commands.study.designs import Factorial, LatinHypercube, Morris, OneAtATime, Sobol, Table
from tolevo.commands.study.page import study_page
from tolevo.commands.study.plan import Design, Factor, StudyData
from tolevo.commands.study.study import FILES, write_analysis

FACTORS = (
    Factor("algorithm.population", (20, 40, 80)),
    Factor("algorithm.rate", low=0.001, high=0.08, log=True, count=3),
    Factor("algorithm.name", ("p", "q")),
)
BASE = {"algorithm.population": 80, "algorithm.rate": 0.08, "algorithm.name": "p"}
DESIGNS = (OneAtATime(), Factorial(), LatinHypercube(samples=20), Morris(10), Sobol(64), Table())


@pytest.fixture(params=DESIGNS, ids=lambda design: design.kind)
def design(request: pytest.FixtureRequest, tmp_path: Path) -> Design:
    if not isinstance(request.param, Table):
        found: Design = request.param
        return found
    file = tmp_path / "settings.csv"
    file.write_text(f"{','.join(BASE)}\n80,0.08,p\n20,0.08,q\n40,0.001,p\n80,0.01,q\n")
    return Table(str(file))


def effect(frame: pd.DataFrame) -> Any:
    size = 40.0 / frame["algorithm.population"].to_numpy(dtype=float)
    return size + np.where(frame["algorithm.name"] == "q", 0.3, 0.0)


def made(synthetic: Any, design: Design, seeds: int) -> tuple[Any, StudyData]:
    settings = synthetic.settings(design, FACTORS, seeds, BASE)
    return settings, synthetic.data(settings, effect, 0.1, np.random.default_rng(1))


def lose(data: StudyData, rows: Any) -> None:
    for column, value in (("status", "failed"), ("reason", "lost"), ("gap_percent", np.nan)):
        data.table.loc[rows, column] = value


def analysis(settings: Any, data: StudyData) -> Any:
    return analyse(settings, data, np.random.default_rng(0))


def test_every_design_comes_to_sensitivities_a_best_setting_and_a_page(synthetic: Any, design: Design) -> None:
    settings, data = made(synthetic, design, 12)
    result = analysis(settings, data)
    known = result.sensitivity.set_index(["key", "statistic"])
    assert known["value"].notna().all() and (known["low"] <= known["high"]).all()
    assert 0.0 < known.loc[("", "noise_share"), "value"] < 0.5
    if design.kind != "table":
        main = {"sobol": "ST", "morris": "mu_star"}.get(design.kind, "anova_share")
        assert known.loc[("algorithm.population", main), "distinct"]
        assert not known.loc[("algorithm.rate", main), "distinct"]
    assert len(result.medians) == len(data.design)
    best = result.recommendations[0]  # the one without a loss
    assert best.settings["algorithm.population"] == 80
    assert best.settings["algorithm.name"] == "p"
    text = study_page(result)
    assert text.startswith("<!DOCTYPE html>") and "algorithm.population" in text


@pytest.mark.parametrize("seeds", [1, 2, 5])
def test_few_seeds_and_lost_settings_claim_nothing(synthetic: Any, design: Design, seeds: int) -> None:
    settings, data = made(synthetic, design, seeds)
    lose(data, data.table.index[data.table["point"] == 1])
    lose(data, [len(data.table) - 1])
    result = analysis(settings, data)
    pairs = result.tests[result.tests["kind"] == "wilcoxon"]
    assert not pairs["significant"].astype(bool).any()
    assert not any(one.shown for one in result.recommendations)
    assert any("runs failed" in note for note in result.notes)
    with blanks() if seeds > 1 else nullcontext():  # the fewest are the hardest to draw
        assert "lost" in study_page(result)


def test_a_study_of_failures_only_is_still_described(synthetic: Any, design: Design) -> None:
    settings, data = made(synthetic, design, 3)
    lose(data, data.table.index)
    result = analysis(settings, data)
    assert result.sensitivity.empty and result.medians["median"].isna().all()
    assert "<h2>Failed runs</h2>" in study_page(result)


def test_statistics_are_written_once_and_again_where_runs_differ(synthetic: Any, tmp_path: Path) -> None:
    settings, data = made(synthetic, OneAtATime(), 8)
    first = write_analysis(settings, data, tmp_path)
    assert all((tmp_path / name).is_file() for name in FILES)
    assert len(pd.read_csv(tmp_path / "tests.csv")) > 0
    (tmp_path / "tests.csv").write_text("kept")
    assert write_analysis(settings, data, tmp_path) == first
    assert (tmp_path / "tests.csv").read_text() == "kept"
    data.table.loc[0, "gap_percent"] = 99.0
    write_analysis(settings, data, tmp_path)
    assert (tmp_path / "tests.csv").read_text() != "kept"
    (tmp_path / "study.json").write_text("{broken")
    (tmp_path / "tests.csv").write_text("gone")
    write_analysis(settings, data, tmp_path)
    assert (tmp_path / "tests.csv").read_text() != "gone"
