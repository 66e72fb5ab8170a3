"""The damper's records and its model, before any workflow sees them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.gap_trial.damper import Jenkins, arts
from tests.gap_trial.tables import Array

PLAIN = ("stiffness_kip_per_in", "slip_force_kip", "start_in")


STEP = [1e-3]
"""Relative step of the differences: the error is only piecewise smooth."""

read = lru_cache(arts)


def force(amplitude: str, p: Array, width: float = 0.0) -> Array:
    model = Jenkins(dict(zip(PLAIN, [*np.abs(p[:2]).tolist(), p[2]], strict=True)))
    table = {str(name): column.to_numpy() for name, column in read(amplitude).items()}
    changes = {"bearing_clearance_in": np.full(1, abs(width))}
    return model.predict(table, np.random.default_rng(0), changes)["force_kip"]


def error(amplitude: str, p: Array, width: float = 0.0) -> float:
    measured = read(amplitude)["force_kip"].to_numpy()
    return float(np.sqrt(np.mean((force(amplitude, p, width) - measured) ** 2)))


def test_loop_of_the_element_is_the_parallelogram_of_its_parameters() -> None:
    """Stiffness 10, slip at 2: the force of a full cycle of 1 in. loses 4 F (A - F/k) of work."""
    turn = np.linspace(0.0, 4.0 * np.pi, 40001)
    path = np.sin(turn)
    model = Jenkins({"stiffness_kip_per_in": 10.0, "slip_force_kip": 2.0})
    for width in (0.0, 0.15):
        found = model.predict({"displacement_in": path}, np.random.default_rng(0),
                              {"bearing_clearance_in": np.full(1, width)})["force_kip"]  # fmt: skip
        second = turn >= 2.0 * np.pi
        work = np.trapezoid(found[second], path[second])
        assert work == pytest.approx(4.0 * 2.0 * (1.0 - 0.2 - width / 2.0), rel=1e-3)
        assert np.abs(found).max() == pytest.approx(2.0)


def test_a_dead_zone_of_an_inch_over_six_is_in_the_record() -> None:
    """Fitted to 1 in., judged on 0.5 in. with its beginning free: by least squares alone."""
    measured = read("1")["force_kip"].to_numpy()
    first = np.array([12.0, 2.0, 0.0])

    def stiff(p: Array) -> Array:
        return np.asarray(force("1", p) - measured)

    def loose(p: Array) -> Array:
        return np.asarray(force("1", p[:3], p[3]) - measured)

    plain = least_squares(stiff, first, diff_step=STEP).x
    full = least_squares(loose, np.append(first, 0.1), diff_step=STEP).x
    assert 0.17 < abs(full[3]) < 0.18

    def best(p: Array, width: float) -> float:
        starts = np.linspace(-0.2, 0.2, 41)
        return min(error("0.5", np.array([*p[:2], at]), width) for at in starts)

    assert best(full, full[3]) < 0.6 * best(plain, 0.0)
