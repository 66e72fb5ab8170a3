"""Columns of effects, and gains of them in rows without a block, against the long way round."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap.blocks import Trained, Training
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.generic import stack_columns
from tolevo.commands.gap.linear import Groups, basis, project_out, ranking
from tolevo.commands.gap.null_model import build_null_model, noise_of
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.scan import Thresholds, dictionary
from tolevo.commands.gap.setup import Setup, prepare_setup
from tolevo.models.effects.effect import grid
from tolevo.models.effects.shapes import Shape

ROWS = 60
HEAD = """
model = "table"
[gear]
orders = { "pin passing" = 39, "crank" = 40, "sun" = 121, "sun against the carrier" = 120 }
[columns]
angle = { role = "angle", unit = "deg" }
torque = { role = "torque", unit = "N m" }
speed = { role = "speed", unit = "rpm" }
way = { role = "direction" }
warmth = { role = "temperature", unit = "degC" }
clock = { role = "time", unit = "s" }
te = { role = "measured", unit = "arcsec" }
te_sim = { role = "predicted", unit = "arcsec", of = "te" }
other = { role = "measured", unit = "arcmin" }
other_sim = { role = "predicted", unit = "arcmin", of = "other" }
"""


def bench() -> pd.DataFrame:
    rng = np.random.default_rng(3)
    names = ("te", "te_sim", "other", "other_sim")
    return pd.DataFrame({
        "angle": rng.uniform(0.0, 360.0, ROWS), "torque": rng.uniform(-200.0, 200.0, ROWS),
        "speed": rng.uniform(1.0, 30.0, ROWS), "way": rng.choice([-1.0, 1.0], ROWS),
        "warmth": rng.uniform(20.0, 40.0, ROWS), "clock": np.arange(ROWS) * 1.0,
        **{name: rng.normal(size=ROWS) for name in names},
    })  # fmt: skip


def set_up(folder: Path) -> Setup:
    configuration, table = folder / "gap.toml", folder / "bench.csv"
    configuration.write_text(HEAD, encoding="utf-8")
    bench().to_csv(table, index=False)
    plan = read_gap(configuration)
    return prepare_setup(plan, read_data(plan, table))


def test_columns_are_what_an_effect_does_per_unit_of_each_coefficient(tmp_path: Path) -> None:
    """Of two outputs: the columns at once, against the effect acting with one coefficient."""
    setup = set_up(tmp_path)
    plain = [one for one in setup.library
             if isinstance(one.effect, Shape) and one.effect.plain(setup.data.target)]  # fmt: skip
    assert {"torsional_compliance", "structural_resonance", "stribeck"} <= {o.name for o in plain}
    for one in plain:
        shape = grid(one.shape, 1.0)[-1]
        each = [setup.columns.total(one, {**shape, number.name: 1e-3}) / 1e-3
                for number in one.linear]  # fmt: skip
        np.testing.assert_allclose(setup.columns.of(one, shape), np.column_stack(each), atol=1e-9)


def test_gains_without_a_block_are_those_of_the_other_rows(tmp_path: Path) -> None:
    """Against groups of the other rows alone, beside the others there; two outputs, with noise that
    remembers, so that the rows of a block do not follow each other.
    """
    setup = set_up(tmp_path)
    noises = noise_of(setup, ())
    noises = tuple(replace(one, rho=0.4) for one in noises)
    book = dictionary(setup.library, setup.columns, 1.0)
    search = build_null_model(setup, noises, book, *stack_columns(setup.generic, 2), Thresholds(20.0, 10.0)).search
    training = Training(search.fitter, search.labels, book, search.white)
    first = {name: book.members[at] for name, (at, _) in book.places.items()}
    names = ("torsional_compliance", "structural_resonance", "encoder_harmonics")
    members = [first[name] for name in names]
    blocks = list(range(1, len(training.rows)))
    found, own = training.gains(members, 1, blocks)
    here, end = book.places["structural_resonance"]
    white = search.white.part(here, end)
    for gains, mine, rows in zip(found, own, training.rows[1:], strict=True):
        seen = np.setdiff1d(np.arange(len(search.fitter.y)), np.arange(training.count)[rows])
        beside_it = [search.fitter.white(members[k])[seen] for k in (0, 2)]
        q = basis(np.hstack([search.fitter.base[seen], *beside_it]))
        alone = Groups(white.columns[seen], white.starts, white.one_sided).orthonormal(q)
        expected = alone.gains(project_out(search.fitter.y[seen], q))
        np.testing.assert_allclose(gains, expected, rtol=1e-7, atol=1e-9)
        assert mine[0] == pytest.approx(expected[0], rel=1e-7)


def test_rows_that_are_held_out_are_predicted_by_a_fit_of_the_others(tmp_path: Path) -> None:
    """Of an effect without nonlinear numbers, against least squares on the other rows."""
    setup = set_up(tmp_path)
    book = dictionary(setup.library, setup.columns, 1.0)
    search = build_null_model(setup, noise_of(setup, ()), book, *stack_columns(setup.generic, 2),
                       Thresholds(20.0, 10.0)).search  # fmt: skip
    member = book.members[book.places["encoder_harmonics"][0]]
    tested = search.tested(search.fitter.fit([member]))
    x = np.hstack([search.fitter.base, search.fitter.white(member)])
    raw = np.hstack([search.fitter.raw_base, setup.columns.of(member.candidate, member.shape)])
    for block in np.unique(search.labels):
        out = np.flatnonzero(search.labels == block)
        seen = np.setdiff1d(np.arange(len(x)), out)
        fit = np.linalg.lstsq(x[seen], search.fitter.y[seen], rcond=None)[0]
        np.testing.assert_allclose(tested.white[out], search.fitter.y[out] - x[out] @ fit)
        np.testing.assert_allclose(tested.fitted[out], raw[out] @ fit)


def test_columns_that_are_there_twice_predict_as_they_do_once() -> None:
    """As a gauge's offset and a free zero: against least squares on the other rows."""
    rng = np.random.default_rng(2)
    once, y = rng.normal(size=(90, 3)), rng.normal(size=90)
    twice = np.column_stack([once, 5.0 * once[:, 0], once[:, 1] - once[:, 2]])
    for out in (slice(0, 9), slice(40, 70), np.arange(1, 90, 7)):
        seen = np.delete(np.arange(90), out)
        expected = once[out] @ np.linalg.lstsq(once[seen], y[seen], rcond=None)[0]
        found = twice[out] @ Trained.of(twice, y).without(out, y)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_a_rounding_decides_neither_what_dependent_columns_span_nor_which_of_equal_gains_is_first() -> None:
    """Three columns of a length, each nearly in the span of the two others."""
    a, b, d = np.linalg.qr(np.random.default_rng(0).normal(size=(5, 3)))[0].T
    columns, y = np.column_stack([a, b, (a + b) / np.sqrt(2.0) + 2e-4 * d]), 1e4 * d
    expected = project_out(y, basis(columns))
    for seed in range(20):
        rounding = 1e-13 * np.random.default_rng(seed).normal(size=(5, 3))
        np.testing.assert_allclose(project_out(y, basis(columns + rounding)), expected, atol=1e-6)
        gains = np.array([3.0, 0.0, 3.0, 7.0, -np.inf]) + rounding[:, 0]
        assert ranking(gains).tolist() == [3, 0, 2, 1, 4]
    assert basis(np.zeros((5, 2))).shape == (5, 0)
    assert ranking([]).tolist() == []
