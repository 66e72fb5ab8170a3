"""Errors in conditions that a record lacks."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.gap.elsewhere import BIC, CONDITIONS, LEVELS, NOTHING, in_record, lost, question, tables
from benchmarks.gap.generator.records import record
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.namers.peers import PEERS
from benchmarks.gap.trial import WORKFLOW


def test_record_and_conditions_beyond_it_share_no_cell() -> None:
    found, _ = record("dominant", 7)
    rows = in_record(found, np.random.default_rng(1))
    assert 0.3 < rows.mean() < 0.7
    levels = {
        name: np.searchsorted(np.quantile(found.table[name], np.arange(1, LEVELS) / LEVELS), found.table[name])
        for name in CONDITIONS
    }
    pairs = [(a, b) for a in CONDITIONS for b in CONDITIONS if a < b]
    cells = [
        {(x, y) for x, y in zip(levels[a][part], levels[b][part], strict=True)}
        for a, b in pairs
        for part in (rows, ~rows)
    ]
    assert any(not first & second for first, second in zip(cells[::2], cells[1::2], strict=True))


def test_a_dominant_effect_is_predicted_where_the_record_ends() -> None:
    answer = question([WORKFLOW, BIC, NOTHING], "dominant", 9003)
    error = {name: said["error"] for name, said in answer["said"].items()}
    assert error[NOTHING] > 5.0
    assert 0.5 < error[WORKFLOW] < 0.2 * error[NOTHING]
    assert 0.5 < error[BIC] < 0.2 * error[NOTHING]
    assert answer["said"][WORKFLOW]["right"] >= 1 and answer["said"][WORKFLOW]["wrong"] == 0
    assert answer["said"][NOTHING] == {"error": error[NOTHING], "right": 0, "wrong": 0}


def test_losses_come_first_and_a_method_counts_in_the_records_that_it_was_asked() -> None:
    def said(error: float) -> dict[str, float]:
        return {"error": error, "right": 1, "wrong": 2}

    found = [
        {"group": "outside", "number": k, "hidden": 1, "said": {WORKFLOW: said(1.0 + 0.1 * k), BIC: said(1.1)}}
        for k in range(4)
    ]
    found[0]["said"]["ADCD"] = said(9.0)  # type: ignore[index]
    assert lost(found, BIC) == ["outside 2", "outside 3"]  # 1.09 and 1.18 times the rival's error
    every, losses = tables(found)
    assert losses == f"{BIC} is better in outside 2, outside 3."
    line = next(one for one in every.splitlines() if one.startswith(f"| {WORKFLOW} |"))
    median = np.median([1.0, 1.1, 1.2, 1.3]) / 1.1
    assert line.startswith(f"| {WORKFLOW} | - of 4 | 4 of 4 | 8 | {median:.3f} |")
    assert f"| {BIC} | 2 of 4 | 4 of 4 | 8 | 1.000 |" in every and "| ADCD | 0 of 1 | 1 of 1 | 2 |" in every


def test_pysindy_keeps_what_its_algorithm_written_again_keeps() -> None:
    pytest.importorskip("pysindy", reason="installed in .venv-bench alone")
    for number in range(5):
        found, _ = record("dominant", number)
        rows = np.ones(len(found.table), dtype=np.bool_)
        names = {one["name"] for one in BASELINES["thresholded least squares"](found)["effects"]}
        assert {*PEERS["PySINDy"](found, rows)[0]} == names
