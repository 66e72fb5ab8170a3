"""Worst cases of formulas: against all corners of 300 random ones, and bounds where there are too many."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest

from tolevo.models.expressions import Formula, Let
from tolevo.models.inputs import Normal
from tolevo.models.stack.extremes import Interval, extremes
from tolevo.models.stack.mechanism import Mechanism

Array = np.ndarray
RANDOM = 300


def mechanism(formula: Formula, mids: dict[str, float], gain: float = 1.0) -> Mechanism:
    names = tuple(mids)
    k, middle = len(names), np.array(list(mids.values()))
    return Mechanism(names, tuple(range(k)), (Normal(),) * k, np.zeros(k), 0.0, formula=formula, mids=middle,
                     scale=np.ones(k), gain=gain)  # fmt: skip


def random_text(rng: np.random.Generator, names: list[str], depth: int) -> str:
    """A random formula of some of the names, defined everywhere within the tolerances of the test."""
    if depth == 0:
        return str(rng.choice(names)) if rng.random() < 0.85 else f"{rng.uniform(0.5, 2.0):.3f}"
    a, b = (random_text(rng, names, depth - 1) for _ in range(2))
    kinds = (
        "({a} + {b})", "({a} - {b})", "({a})*({b})", "({a})/(2.5 + abs({b}))", "sin({a})", "cos({a} - {b})",
        "atan({a})", "sqrt(0.1 + ({a})**2)", "exp(({a})/9)", "min({a}, {b})", "max({a}, {b}, 1.1)", "abs({a})",
        "({a})**2", "({a})**3", "log(0.3 + abs({a}))", "atan2({a}, 9 + abs({b}))", "tan(({a})/(9 + abs({a})))",
        "(0.2 + abs({a}))**0.7",
        "(3 + abs({a}))**-2", "asin(({a})/(3 + abs({a})))", "acos(({a})/(3 + abs({a})))", "(1.2 + sin({a}))**({b}/9)",
    )  # fmt: skip
    return str(rng.choice(kinds)).format(a=a, b=b)


def all_corners(formula: Formula, mids: dict[str, float], t: Array) -> Array:
    signs = np.array(list(product((-1.0, 1.0), repeat=len(mids)))).T
    x = {name: mid + half * row for (name, mid), half, row in zip(mids.items(), t, signs, strict=True)}
    return np.broadcast_to(formula.value(x), signs.shape[1])


@pytest.mark.parametrize("seed", range(10))
def test_no_corner_of_random_formulas_lies_beyond(seed: int) -> None:
    """30 formulas of 3 to 9 parts each; where the worst case is by corners, units reach both ends."""
    rng = np.random.default_rng(seed)
    for _ in range(RANDOM // 10):
        names = [f"p{at}" for at in range(rng.integers(3, 10))]
        mids = {name: float(rng.uniform(-2.0, 2.0)) for name in names}
        t = rng.uniform(0.01, 0.6, len(names))
        text = " + ".join(random_text(rng, names, int(rng.integers(1, 4))) for _ in range(3)) + "".join(
            f" + 0.1*{name}" for name in names
        )
        formula, gain = Formula(text), float(rng.choice([-2.0, 3.0]))
        found = extremes(mechanism(formula, mids, gain), t)
        corners = gain * all_corners(formula, mids, t)
        slack = 1e-12 * np.ptp(corners)
        assert found.least <= corners.min() + slack and found.greatest >= corners.max() - slack, text
        assert found.kind == "corners"
        units = {name: mids[name] + half * rng.uniform(-1.0, 1.0, 2000) for name, half in zip(names, t, strict=True)}
        y = gain * formula.value(units)
        inside = max(y.max() - found.greatest, found.least - y.min())
        assert inside <= 1e-9 * np.ptp(y), text  # the best of 4096 points is moved on


def test_seventy_parts_of_which_all_are_monotone_are_by_corners() -> None:
    """prod (1 + p_i/50): 2^70 corners, of which the intervals of the slopes leave one."""
    names = [f"p{at}" for at in range(70)]
    text = " * ".join(f"(1 + {name}/50)" for name in names)
    found = extremes(mechanism(Formula(text), dict.fromkeys(names, 1.0)), np.full(70, 0.1))
    assert found.kind == "corners"
    np.testing.assert_allclose([found.least, found.greatest], [(1.0 + 0.9 / 50.0) ** 70, (1.0 + 1.1 / 50.0) ** 70])


def test_seventy_parts_about_a_kink_have_a_bound() -> None:
    """sum |p_i| + p_i^2 + p_i p_(i+1)/9 about 0: none is monotone, the greatest corner has all of one sign."""
    names = [f"p{at}" for at in range(70)]
    squares = " + ".join(f"(abs({name}) + {name}**2)" for name in names)
    pairs = " + ".join(f"{a}*{b}/9" for a, b in pairwise(names))
    formula = Formula(f"{squares} + ({pairs})")
    found = extremes(mechanism(formula, dict.fromkeys(names, 0.0)), np.full(70, 0.3))
    assert found.kind == "bound"
    greatest = 70 * (0.3 + 0.09) + 69 * 0.01
    assert greatest <= found.greatest <= 1.001 * greatest
    assert found.least == pytest.approx(-69 * 0.01, rel=1e-3)  # each product at its least: a bound, not reached


def test_bounds_hold_for_units_and_corners_of_many_parts() -> None:
    rng = np.random.default_rng(5)
    names = [f"p{at}" for at in range(24)]
    triples = zip(names, names[3:], names[7:], strict=False)
    text = " + ".join(f"sin(3*{a}*{b}) + {a}*abs({b} - {c})" for a, b, c in triples)
    formula = Formula(text)
    names = [name for name in names if name in formula.names]
    mids = {name: float(rng.uniform(-0.3, 0.3)) for name in names}
    t = rng.uniform(0.3, 0.5, len(names))
    found = extremes(mechanism(formula, mids), t)
    assert found.kind == "bound"
    z = np.sign(rng.uniform(-1.0, 1.0, (len(names), 200_000)))
    x = {name: mid + half * row for (name, mid), half, row in zip(mids.items(), t, z, strict=True)}
    y = formula.value(x)
    assert found.least <= y.min() and y.max() <= found.greatest
    assert found.greatest - found.least < 10.0 * np.ptp(y)


def test_an_intermediate_quantity_is_part_of_the_formula() -> None:
    """(a - b)^2 + 3 a with s = a - b named: at a = 1 +- 0.1, b = 0.5 +- 0.2 monotone in both."""
    formula = Formula("s**2 + 3*a", (Let("s", Formula("a - b")),))
    found = extremes(mechanism(formula, {"a": 1.0, "b": 0.5}), np.array([0.1, 0.2]))
    np.testing.assert_allclose(found[:2], [0.2**2 + 2.7, 0.8**2 + 3.3], rtol=1e-14)


FUNCTIONS = [np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.sqrt, np.exp, np.log, np.absolute, np.sign,
             np.negative]  # fmt: skip
PAIRS = [np.add, np.subtract, np.multiply, np.divide, np.power, np.arctan2, np.minimum, np.maximum, np.less,
         np.less_equal, np.greater, np.greater_equal]  # fmt: skip


@pytest.mark.parametrize("function", [*FUNCTIONS, *PAIRS])
def test_intervals_hold_every_value(function: np.ufunc) -> None:
    """4000 random points of 200 random boxes, some about 0; values that are none are left out."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        ends = np.sort(rng.normal(0.0, rng.choice([0.5, 4.0]), (2, 2)), axis=1)
        if function is np.power and rng.random() < 0.6:
            ends[1] = float(rng.integers(-3, 4))
        boxes = [Interval(*pair) for pair in ends[: function.nin]]
        x = [rng.uniform(pair[0], pair[1], 4000) for pair in ends[: function.nin]]
        with np.errstate(all="ignore"):
            found, y = function(*boxes), function(*x).astype(float)
        y = y[np.isfinite(y)]
        if len(y):
            assert found.low <= y.min() and y.max() <= found.high, (ends, found.low, found.high)
