"""Errors in conditions that a record lacks."""

from __future__ import annotations

import numpy as np

from benchmarks.gap.elsewhere import CONDITIONS, LEVELS, in_record, question
from benchmarks.gap.generator.records import record


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
    error = question("dominant", 9003)
    assert error.nothing > 5.0
    assert 0.5 < error.tolevo < 0.2 * error.nothing
    assert 0.5 < error.bic < 0.2 * error.nothing
