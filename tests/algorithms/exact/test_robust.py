"""The allocation of least worst regret against every corner of the factors, each solved by SLSQP of scipy."""

from __future__ import annotations

import tomllib
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy import optimize

import tolevo
from tolevo.algorithms.exact.robust import RobustAllocation, robust_allocation
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.section import Array

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only

LOW, HIGH = 0.01, 0.3
KINDS = ("reciprocal", "reciprocal_squared", "exponential")


def drawn(rng: np.random.Generator) -> dict[str, Any]:
    """A stack of 2 to 5 parts with curves of three kinds, each known within a factor."""
    parts: list[dict[str, Any]] = []
    for at in range(int(rng.integers(2, 6))):
        kind = str(rng.choice(KINDS))
        size = {"reciprocal": 1.0, "reciprocal_squared": 0.05, "exponential": 20.0}[kind]
        curve = {"model": kind, "a": float(rng.uniform(0.5, 2.0)), "b": size * float(rng.uniform(0.02, 0.3))}
        curve |= {"m": float(rng.uniform(5.0, 30.0))} if kind == "exponential" else {}
        size = float(rng.uniform(0.4, 2.0) * rng.choice([-1.0, 1.0]))
        part: dict[str, Any] = {
            "name": f"p{at}",
            "nominal": 5.0,
            "unit": "mm",
            "sensitivity": size,
            "t_min": LOW,
            "t_max": HIGH,
        }
        parts.append(part | {"cost": curve})
    reach = 0.1 * np.sqrt(sum(part["sensitivity"] ** 2 for part in parts))
    return {
        "problem": "stack",
        "references": "none",
        "requirement": {"name": "gap", "unit": "mm", "method": "rss" if rng.random() < 0.7 else "worst_case"},
        "objectives": {"minimise": ["cost"]},
        "limits": {"variation": float(reach * rng.uniform(0.5, 1.5))},
        "part": parts,
        "robust": {"factor": float(rng.uniform(1.1, 2.0)), "factors": {"p0": float(rng.uniform(1.0, 3.0))}},
    }


class Corners:
    """The worst regret of an allocation by every corner of the factors."""

    def __init__(self, tables: dict[str, Any]) -> None:
        problem = read(tables).problem
        assert problem is not None
        self.problem = problem
        self.curves = [problem.curves_of(name)[0][0] for name in problem.names]
        self.size = np.abs([part["sensitivity"] for part in tables["part"]])
        self.limit, self.worst_case = tables["limits"]["variation"], tables["requirement"]["method"] == "worst_case"
        factors = [tables["robust"]["factors"]["p0"], *[tables["robust"]["factor"]] * (len(self.curves) - 1)]
        self.corners = [np.array(c) for c in product(*[(1.0 / f, f) for f in factors])]
        self.least = [self._least(c) for c in self.corners]

    def costs(self, t: Array) -> Array:
        return np.array([curve.cost(np.array([value]))[0] for curve, value in zip(self.curves, t, strict=True)])

    def variation(self, t: Array) -> float:
        return float(self.size @ t if self.worst_case else np.sqrt(np.sum((self.size * t) ** 2)))

    def _least(self, factor: Array) -> float:
        ends = [(np.log(LOW), np.log(HIGH))] * len(factor)
        rows = [{"type": "ineq", "fun": lambda y: 1.0 - self.variation(np.exp(y)) / self.limit}]
        found = []
        for start in (0.05, 0.15):
            t = np.full(len(factor), start) * min(1.0, self.limit / self.variation(np.full(len(factor), start)))
            options = {"maxiter": 500, "ftol": 1e-14}
            one = minimize(
                lambda y: float(factor @ self.costs(np.exp(y))),
                np.log(t),
                bounds=ends,
                constraints=rows,
                options=options,
            )
            if self.variation(np.exp(one.x)) <= self.limit * (1.0 + 1e-7):
                found.append(float(one.fun))
        return min(found)

    def regret(self, x: Array) -> float:
        costs = self.costs(x[0])
        return max(float(c @ costs) - least for c, least in zip(self.corners, self.least, strict=True))


@pytest.mark.parametrize("seed", range(8))
def test_regrets_are_those_of_the_worst_corner(seed: int) -> None:
    corners = Corners(drawn(np.random.default_rng(seed)))
    found = robust_allocation(corners.problem)
    assert isinstance(found, RobustAllocation)
    worst, nominal = corners.regret(found.x), corners.regret(found.nominal_x)
    assert worst <= found.regret * (1.0 + 1e-5) + 1e-9
    assert worst == pytest.approx(found.regret, rel=0.02)
    assert nominal == pytest.approx(found.nominal, rel=0.02)
    assert found.regret <= found.nominal
    assert found.least <= worst * (1.0 + 1e-5)
    assert found.least >= 0.98 * found.regret
    rng = np.random.default_rng(100 + seed)
    t = np.exp(rng.uniform(np.log(LOW), np.log(HIGH), (400, len(corners.curves))))
    size = np.array([corners.variation(one) for one in t])
    t = np.clip(t * np.minimum(1.0, corners.limit / size)[:, None], LOW, HIGH)
    kept = [one for one in t if corners.variation(one) <= corners.limit * (1.0 + 1e-12)]
    assert len(kept) > 100
    assert min(corners.regret(one[None]) for one in kept) >= found.least * (1.0 - 1e-6)


def processed() -> dict[str, Any]:
    tables = drawn(np.random.default_rng(3))
    ways = [
        {"name": "turned", "t_min": 0.05, "t_max": 0.3, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.2}},
        {"name": "ground", "t_min": 0.01, "t_max": 0.2, "cost": {"model": "reciprocal", "a": 1.5, "b": 0.1}},
    ]
    part = {"name": "p0", "nominal": 5.0, "unit": "mm", "sensitivity": 1.0, "process": ways}
    tables["part"][0] = part
    tables["robust"]["factors"]["p0"] = {"turned": 1.2, "ground": 2.0}
    return tables


def test_each_process_has_a_curve_of_its_own() -> None:
    """For both processes: the regret of the robust allocation is found by drawn scenarios, and no larger."""
    problem = read(processed()).problem
    assert problem is not None
    found = robust_allocation(problem)
    assert isinstance(found, RobustAllocation)
    assert found.least >= 0.98 * found.regret
    design, rng = problem.complete(found.x), np.random.default_rng(5)
    low, high = problem.xl, problem.xu
    others = problem.complete(low + (high - low) * rng.random((4000, len(low))))
    others = others[np.all(problem.tested(others)[1] <= 0.0, axis=1)]
    assert len(others) > 50
    robust = problem.settings.robust
    assert robust is not None
    regrets = []
    for _ in range(300):
        side = rng.integers(0, 2, (len(problem.names), 2)) * 2.0 - 1.0

        def cost(designs: Array, side: Any = side) -> Array:
            each, total = problem.costs_of(designs), np.zeros(len(designs))
            for name, values in each.items():
                way = (
                    np.rint(problem.column(designs, "p0_process")).astype(int)
                    if name == "p0_t"
                    else np.zeros(len(values), int)
                )
                factors = np.array([robust.of(name, at) for at in range(2)], dtype=float)
                total += values * factors[way] ** side[problem.names.index(name)][way]
            return total

        regrets.append(float(cost(design)[0] - cost(others).min()))
    assert max(regrets) <= found.regret * (1.0 + 1e-9)
    assert max(regrets) >= 0.5 * found.regret


def test_a_run_says_what_the_regrets_are() -> None:
    tables = drawn(np.random.default_rng(1)) | {"currency": "EUR"}
    result = tolevo.run(tables)
    summary: Any = result.summary["robust"]
    row = result.references.set_index("label").loc["least worst regret"]
    assert row["worst_regret"] == summary["worst_regret"]
    assert summary["worst_regret_bound"] <= summary["worst_regret"] <= summary["least_cost_worst_regret"]
    assert summary["unit"] == "EUR"
    assert row["feasible"]
    notes = " ".join(map(str, result.summary["notes"]))
    assert "whatever the true curves" in notes
    again = tomllib.loads(tolevo.check(tables))
    assert again["robust"]["factor"] == tables["robust"]["factor"]
    assert read(again).problem.settings.robust == read(tables).problem.settings.robust  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("tables", "place", "message"),
    [
        ({"robust": {"factors": {"p0": 1.5}}}, "robust.factors.p1", "is missing"),
        ({"robust": {"factor": 0.5}}, "robust.factor", "[1, 1000]"),
        ({"robust": {"factor": 1.5, "factors": {"q": 2.0}}}, "robust.factors.q", "no part"),
        ({"robust": {"factor": 1.5}, "objectives": {"minimise": ["cost", "variation"]}}, "robust", "only objective"),
        ({"robust": {"factor": "much"}}, "robust.factor", "a number"),
    ],
)
def test_a_curve_without_factor_is_a_fault(tables: dict[str, Any], place: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        read(drawn(np.random.default_rng(2)) | tables)
    assert any(fault.place == place and message in fault.message for fault in error.value.faults), error.value.faults
