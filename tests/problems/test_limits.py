"""When a limit is kept: one rule for the search, the bound, and the evaluation of a design.

Stacks of grades and machines alone are enumerated by closed forms: sums of tolerances, roots of sums of
squares, and yields of normal deviations.
"""

from __future__ import annotations

import itertools
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

import tolevo
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.errors import Fault
from tolevo.problems.limits import LIMIT_ROUNDING, Limit, descending, loosened, overlap
from tolevo.problems.settings import Bound, Settings
from tolevo.problems.stack import Stack
from tolevo.section import Section

CASES = Path(__file__).parents[1] / "cases"
YIELD_ROOM = 4e-13
"""Rounding of a yield in percent."""


def limit(low: float = -np.inf, high: float = np.inf, most: float = np.inf) -> Limit:
    return Limit("v", low, high, 0.5, "mm", most)


def test_a_limit_that_is_met_to_rounding_is_kept_everywhere_and_a_real_excess_breaks_it() -> None:
    kept, broken = 0.1 + 0.2, 0.3 * (1.0 + 1e-8)
    values = np.array([kept, broken, 0.2])
    upper = limit(high=0.3)
    assert kept > 0.3
    np.testing.assert_array_equal(upper.kept(values), [True, False, True])
    np.testing.assert_array_equal(upper.violations(values)[0] > 0.0, [False, True, False])
    np.testing.assert_array_equal(upper.margins(values)["margin_v"] >= 0.0, [True, False, True])
    lower = limit(low=-0.3)
    np.testing.assert_array_equal(lower.kept(-values), [True, False, True])
    np.testing.assert_array_equal(lower.margins(-values)["margin_v"] >= 0.0, [True, False, True])


def test_the_room_is_a_fraction_of_the_limit_in_any_unit_and_of_what_a_yield_lacks() -> None:
    for unit in (1e-6, 1.0, 1e6):
        assert limit(high=0.3 * unit).room(0.3 * unit) == pytest.approx(0.3 * unit * LIMIT_ROUNDING)
    assert limit(high=0.0).room(0.0) == pytest.approx(0.5 * LIMIT_ROUNDING)
    assert limit(low=99.73, most=100.0).room(99.73) == pytest.approx(0.27 * LIMIT_ROUNDING)
    assert limit(low=100.0, most=100.0).room(100.0) < 1e-12
    assert limit(high=1.0).room(np.inf) == np.inf


def test_ranges_that_meet_in_their_last_digits_have_a_point_in_common() -> None:
    assert overlap((0.1, 0.3), (0.2, 0.5)) == (0.2, 0.3)
    assert overlap((0.1 + 0.2, 0.5), (0.0, 0.3)) == (0.1 + 0.2,) * 2
    assert overlap((0.0, 0.3), (0.1 + 0.2, 1.0)) == (0.3, 0.3)
    assert overlap((0.31, 0.5), (0.0, 0.3)) is None
    np.testing.assert_array_equal(loosened(np.array([np.inf, -np.inf])), [np.inf, -np.inf])


def test_what_is_equal_but_for_a_solver_keeps_its_order() -> None:
    """Of symmetric parts the last digits of a processor would name the first otherwise."""
    assert descending(np.array([1.0, 3.0, 3.0 + 1e-9, 2.0, 3.0 - 1e-9])).tolist() == [1, 2, 4, 3, 0]
    assert descending(np.zeros(3)).tolist() == [0, 1, 2]
    assert descending(np.zeros(0)).tolist() == []


def test_a_margin_within_rounding_is_zero() -> None:
    limit = Limit("a", -np.inf, 0.3, 1.0, "mm")
    assert limit.margins(np.array([0.1 + 0.2, 0.3 - 1e-11, 0.2, 0.4]))["margin_a"] == pytest.approx(
        [0.0, 0.0, 0.1, -0.1], abs=1e-15
    )


@pytest.mark.parametrize(("name", "cost"), [("grades", 6.0), ("machines", 2.0)])
def test_cases_whose_cheapest_design_meets_its_limit_exactly(name: str, cost: float) -> None:
    run = tolevo.run(str(CASES / "limit_met_exactly" / f"{name}.toml"))
    assert run.front["cost"].tolist() == [cost] and run.front["gap_percent"].tolist() == [0.0]


@pytest.mark.parametrize("unit", ["mm", "um", "in", "mm_small"])
def test_a_yield_about_a_large_nominal_has_one_least_cost_in_every_unit(unit: str) -> None:
    """26.76331 by the normal and truncated normal laws, whatever lengths are written in."""
    problem = tolevo.read(str(CASES / "scale" / f"{unit}.toml")).problem
    assert problem is not None
    result = search(problem, Exact(), Budget(), 1)
    assert result.f[:, 0].tolist() == pytest.approx([26.763305], rel=1e-7)
    assert proof(problem, {"cost": result.f[:, 0]}, 1).bound[0] == pytest.approx(26.763305, rel=1e-7)
    assert problem.outputs_of(problem.complete(result.x))["yield_percent"][0] >= 99.73


def test_a_design_that_meets_its_limit_exactly_is_feasible() -> None:
    folder = CASES / "limit_met_exactly"
    frame = tolevo.evaluate(str(folder / "grades.toml"), pd.read_csv(folder / "designs.csv"))
    assert frame["feasible"].tolist() == [True] and frame["margin_worst_case"].tolist() == [0.0]


class Discrete:
    """A random stack of grades and machines, one to three requirements, and its choices enumerated."""

    def __init__(self, seed: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.kinds = rng.choice(["worst_case", "rss", "yield_percent"], int(rng.integers(1, 4))).tolist()
        self.off = rng.choice([0.0, 0.2, 0.5], len(self.kinds))
        count = int(rng.integers(2, 5))
        slopes = rng.choice([1.0, -1.0, 0.3, -0.5], (count, len(self.kinds)))
        self.slope, self.counts = np.abs(slopes), rng.choice([1, 1, 2], count)
        nominal = rng.choice([5.0, 12.5, 25.0, 47.2, 118.0], count)
        self.centre = self.counts * nominal @ slopes
        self.parts = ""
        prices = [np.sort(np.round(rng.uniform(1.0, 20.0, 3), 1))[::-1].tolist() for _ in range(count)]
        for at in range(count):
            by_requirement = ", ".join(f"r{k} = {slope}" for k, slope in enumerate(slopes[at]))
            self.parts += f'[[part]]\nname = "p{at}"\nnominal = {nominal[at]}\ncount = {self.counts[at]}\n'
            self.parts += f"sensitivity = {{ {by_requirement} }}\n"
            if rng.random() < 0.5:
                names = [f"IT{6 + way}" for way in range(3)]
                priced = ", ".join(f"{name} = {price}" for name, price in zip(names, prices[at], strict=True))
                self.parts += f'grade = ["IT6", "IT8"]\nprice = {{ {priced} }}\n'
            else:
                for way, t in enumerate(np.sort(np.round(rng.uniform(0.003, 0.04, 3), 3)).tolist()):
                    self.parts += f'[[part.machine]]\nname = "m{way}"\nsigma = {t / 3.0!r}\nprice = {prices[at][way]}\n'
        self.ways = np.array(list(itertools.product(range(3), repeat=count)))
        widths = [[process.low for process in part.processes] for part in self.stack([1.0] * 3, {}).definition.parts]
        self.t = np.take_along_axis(np.array(widths), self.ways.T, axis=1).T
        self.cost = np.take_along_axis(np.array(prices), self.ways.T, axis=1).T @ self.counts
        self.rss = np.sqrt(self.t**2 @ (self.counts[:, None] * self.slope**2))

    def stack(self, halves: list[float], limits: dict[str, Bound]) -> Stack:
        text = '[objectives]\nminimise = ["cost"]\n'
        for at, (kind, off, half) in enumerate(zip(self.kinds, self.off, halves, strict=False)):
            lower, upper = float(self.centre[at] - half * (1.0 - off)), float(self.centre[at] + half)
            method = "rss" if kind == "yield_percent" else kind
            text += f'[[requirement]]\nname = "r{at}"\nunit = "mm"\nlower = {lower}\nupper = {upper}\n'
            text += f'method = "{method}"\n'
        faults: list[Fault] = []
        configured = Stack.configured(Section(tomllib.loads(text + self.parts), "", faults))
        assert faults == [] and configured is not None
        made = configured(Settings(objectives=("cost",), limits=limits))
        assert isinstance(made, Stack)
        return made

    def limited(self, exactly: bool) -> tuple[Stack, np.ndarray]:
        """The stack at limits that a random choice meets exactly, or keeps; which choices keep them."""
        at, rng = int(self.rng.integers(len(self.ways))), self.rng
        halves = np.round(self.rss[at] * rng.uniform(0.8, 1.3, len(self.kinds)), 4)
        limits, kept = {}, np.ones(len(self.ways), dtype=bool)
        for row, kind in enumerate(self.kinds):
            if kind == "yield_percent":
                std, half = self.rss[:, row] / 3.0, halves[row]
                value = 100.0 * (norm.cdf(half / std) - norm.cdf(-half * (1.0 - self.off[row]) / std))
                low = float(value[at] if exactly else value[at] - 0.3 * rng.random() * (100.0 - value[at]))
                limits[f"r{row}.{kind}"] = Bound(low=max(low, 50.1))
                kept &= value >= max(low, 50.1) - 1e-9 * (100.0 - low) - YIELD_ROOM
                continue
            value = self.t @ (self.counts * self.slope[:, row]) if kind == "worst_case" else self.rss[:, row]
            high = float(value[at] if exactly else value[at] * (1.0 + 0.2 * rng.random()))
            high = round(high, 9) if kind == "worst_case" and exactly else high
            limits[f"r{row}.{kind}"] = Bound(high=high)
            kept &= value <= high * (1.0 + 1e-9)
        return self.stack(halves.tolist(), limits), kept


@pytest.mark.parametrize("exactly", [True, False])
def test_discrete_stacks_have_the_cost_of_their_enumeration_and_its_design_is_feasible(exactly: bool) -> None:
    for seed in range(15):
        discrete = Discrete(seed)
        problem, kept = discrete.limited(exactly)
        assert np.any(kept) or not exactly
        if not np.any(kept):
            continue
        best = int(np.argmin(np.where(kept, discrete.cost, np.inf)))
        result = search(problem, Exact(), Budget(), 1)
        np.testing.assert_allclose(result.f, [[discrete.cost[best]]], rtol=1e-12, err_msg=f"seed {seed}")
        bound = proof(problem, {"cost": discrete.cost[[best]]}, 1).bound[0]
        assert bound <= discrete.cost[best] * (1.0 + 1e-12)
        columns = {f"p{at}_t": t for at, t in enumerate(discrete.t[best])}
        columns |= {f"p{at}_process": float(way) for at, way in enumerate(discrete.ways[best])}
        frame = problem.frame(np.array([[columns[name] for name in problem.names]]))
        assert bool(frame["feasible"][0])
        assert min(float(frame[f"margin_{limit.name}"][0]) for limit in problem.limits) >= 0.0


def test_one_value_far_from_the_others_does_not_make_them_equal() -> None:
    for values, order in (
        ([1.0, 3.0, np.nan, 2.0], [1, 3, 0, 2]),
        ([1.0, 3.0, -np.inf, 2.0], [1, 3, 0, 2]),
        ([-9.0, -7.0, -8.0, -1e8], [1, 2, 0, 3]),
        ([1.0, 1.0 + 1e-9, 2.0, 1e-17, 0.0], [2, 0, 1, 3, 4]),
    ):
        assert descending(np.array(values)).tolist() == order
