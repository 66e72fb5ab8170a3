"""Columns of effects, and gains of them in rows without a block, against the long way round."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tolevo.configuration.gap import read_gap
from tolevo.models.effects.shapes import Shape
from tolevo.workflows.gap.blocks import Without
from tolevo.workflows.gap.library import grid
from tolevo.workflows.gap.linear import basis, beside, joined, products
from tolevo.workflows.gap.read import read_data
from tolevo.workflows.gap.setup import prepared

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


def test_columns_are_what_an_effect_does_per_unit_of_each_coefficient(tmp_path: Path) -> None:
    """Of two outputs: the columns at once, against the effect acting with one coefficient."""
    configuration, table = tmp_path / "gap.toml", tmp_path / "bench.csv"
    configuration.write_text(HEAD, encoding="utf-8")
    bench().to_csv(table, index=False)
    plan = read_gap(configuration)
    setup = prepared(plan, read_data(plan, table))
    plain = [one for one in setup.library
             if isinstance(one.effect, Shape) and one.effect.plain(setup.data.target)]  # fmt: skip
    assert {"torsional_compliance", "structural_resonance", "stribeck"} <= {o.name for o in plain}
    for one in plain:
        shape = grid(one, 1.0)[-1]
        each = [setup.columns.total(one, {**shape, number.name: 1e-3}) / 1e-3
                for number in one.linear]  # fmt: skip
        np.testing.assert_allclose(setup.columns.of(one, shape), np.column_stack(each), atol=1e-9)


def test_gains_without_a_block_are_those_of_the_other_rows() -> None:
    """Against a fit in which the rows of the block are zero."""
    rng = np.random.default_rng(5)
    others, y = rng.normal(size=(200, 6)), rng.normal(size=200)
    groups = joined([rng.normal(size=(200, size)) for size in (1, 2, 2, 3)], [True, *[False] * 3])
    out = np.arange(40, 80)
    found = Without.of(groups, basis(others), y).gains(out)
    others[out], y[out] = 0.0, 0.0
    q = basis(others)
    expected = groups.gains_beside(*products(groups, q, beside(y, q)), out)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
