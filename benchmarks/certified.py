"""`certify` on results of five packages on six problems: whether each bound holds, and where none is stated.

A bound holds where no feasible design that is as good in the other objectives lies below it: those of all results,
and those of SLSQP from several starts at the values of each point. A package that is not installed is left out;
the rest is `python -m benchmarks.certified`.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from scipy import optimize

import tolevo
from tolevo.section import Array

descend: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only

EVALUATIONS = 1200
"""Of each package."""
STARTS = 4
CHECKED = 4
"""Points of a result at whose values SLSQP looks for a better design."""
PENALTY = 1e3
"""Of a broken constraint, for packages that take none."""
NONE = "no form"


@dataclass(frozen=True, eq=False)
class Case:
    """A problem: objectives F (n, m) and constraints G (n, k) <= 0 of designs (n, d); `form`: whether one is known."""

    name: str
    low: Array
    high: Array
    evaluate: Callable[[Array], tuple[Array, Array]]
    form: bool

    def plain(self) -> Problem:
        """The same as a problem of pymoo."""
        f, g = self.evaluate(self.low[None])
        case = self

        class Plain(Problem):
            def __init__(self) -> None:
                super().__init__(
                    n_var=len(case.low), n_obj=f.shape[1], n_ieq_constr=g.shape[1], xl=case.low, xu=case.high
                )

            def _evaluate(self, x: Array, out: Any, *args: Any, **kwargs: Any) -> None:
                out["F"], constraints = case.evaluate(x)
                if constraints.shape[1]:
                    out["G"] = constraints

        return Plain()

    def penalised(self, x: Any) -> Array:
        """Objectives (m,) of one design, with a penalty on each."""
        f, g = self.evaluate(np.atleast_2d(np.asarray(x, dtype=float)))
        return np.asarray(f[0] + PENALTY * np.maximum(g[0], 0.0).sum())


A, B, NO = np.array([1.0, 2.0, 3.0, 1.5]), np.array([3.0, 1.0, 2.0, 1.2]), np.zeros
Q = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]])


def _box(count: int, low: float, high: float) -> tuple[Array, Array]:
    return np.full(count, low), np.full(count, high)


CASES = (
    Case(
        "cost against root sum square",
        *_box(4, 0.1, 2.0),
        lambda x: (np.column_stack([(A / x).sum(1), np.sqrt(((B * x) ** 2).sum(1))]), NO((len(x), 0))),
        True,
    ),
    Case(
        "least cost, worst case limited",
        *_box(4, 0.1, 2.0),
        lambda x: ((A / x**2).sum(1)[:, None], ((B * x).sum(1) - 3.0)[:, None]),
        True,
    ),
    Case(
        "convex quadratic, linear row",
        *_box(3, -2.0, 2.0),
        lambda x: (np.einsum("ni,ij,nj->n", x - 1.0, Q, x - 1.0)[:, None], (x.sum(1) - 1.0)[:, None]),
        True,
    ),
    Case(
        "linear, two rows",
        *_box(3, 0.0, 2.0),
        lambda x: (-(x @ A[:3])[:, None], np.column_stack([x @ B[:3] - 4.0, x.sum(1) - 3.0])),
        True,
    ),
    Case(
        "product of powers",
        *_box(3, 0.2, 3.0),
        lambda x: (
            np.column_stack([1.0 / (x[:, 0] * x[:, 1]) + x[:, 2] ** 0.5, x[:, 0] * x[:, 1] ** 2 / x[:, 2]]),
            NO((len(x), 0)),
        ),
        True,
    ),
    Case("waves", *_box(3, -2.0, 2.0), lambda x: ((x**2 + np.cos(7.0 * x)).sum(1)[:, None], NO((len(x), 0))), False),
)

# The packages: each searches a case from a seed and hands over what it returns itself.


def of_pymoo(case: Case, seed: int) -> Any:
    problem = case.plain()
    method = NSGA2(pop_size=40) if problem.n_obj > 1 else GA(pop_size=40)
    return minimize(problem, method, ("n_eval", EVALUATIONS), seed=seed)


def of_pygmo(case: Case, seed: int) -> Any:
    import pygmo

    objectives = len(case.penalised(case.low))

    class Own:
        def fitness(self, x: Array) -> Array:
            return case.penalised(x)

        def get_bounds(self) -> tuple[Array, Array]:
            return case.low, case.high

        def get_nobj(self) -> int:
            return objectives

    steps = EVALUATIONS // 40 - 1
    method = pygmo.nsga2(gen=steps, seed=seed) if objectives > 1 else pygmo.sade(gen=steps, seed=seed)
    return pygmo.algorithm(method).evolve(pygmo.population(pygmo.problem(Own()), 40, seed=seed))


def of_optuna(case: Case, seed: int) -> Any:
    optuna: Any = importlib.import_module("optuna")

    optuna.logging.set_verbosity(optuna.logging.ERROR)

    def objective(trial: Any) -> tuple[float, ...]:
        ends = zip(case.low.tolist(), case.high.tolist(), strict=True)
        return tuple(case.penalised([trial.suggest_float(f"x{at}", *pair) for at, pair in enumerate(ends, 1)]).tolist())

    directions = ["minimize"] * len(case.penalised(case.low))
    sampler = optuna.samplers.NSGAIISampler(population_size=20, seed=seed)
    study = optuna.create_study(directions=directions, sampler=sampler)
    study.optimize(objective, n_trials=EVALUATIONS // 4)
    return study


def of_vamos(case: Case, seed: int) -> Any:
    vamos: Any = importlib.import_module("vamos")
    count, objectives = len(case.low), len(case.penalised(case.low))

    class Own:
        n_var, n_obj, n_constr, n_constraints = count, objectives, 0, 0
        xl, xu, encoding = case.low, case.high, "real"

        def evaluate(self, x: Array, out: Any) -> None:
            out["F"] = np.array([case.penalised(row) for row in x])

    return vamos.optimize(Own(), algorithm="nsgaii", max_evaluations=EVALUATIONS, pop_size=40, seed=seed)


def of_array(case: Case, seed: int) -> Any:
    """The best of random designs: an array, which is all that is known of them."""
    x = np.random.default_rng(seed).uniform(case.low, case.high, (EVALUATIONS, len(case.low)))
    f, g = case.evaluate(x)
    rank = np.argsort(f[:, 0] + PENALTY * np.maximum(g, 0.0).sum(1), kind="stable")
    return x[rank[:20]]


PACKAGES: dict[str, Callable[[Case, int], Any]] = {
    "pymoo": of_pymoo,
    "pygmo": of_pygmo,
    "optuna": of_optuna,
    "vamos": of_vamos,
    "array": of_array,
}


# Whether a bound holds.


def least_known(case: Case, bounded: int, level: Array, pool: Array) -> float:
    """The least value of an objective that anyone finds at no more than a level (m,) of the others."""
    f, g = case.evaluate(pool)
    others = [at for at in range(f.shape[1]) if at != bounded]
    as_good = np.all(f[:, others] <= level[others], axis=1) & np.all(g <= 0.0, axis=1)
    best = float(np.min(f[as_good, bounded], initial=np.inf))

    def rows(x: Array) -> Array:
        values, broken = case.evaluate(x[None])
        return np.concatenate([level[others] - values[0, others], -broken[0]])

    starts = pool[np.flatnonzero(as_good)[:: max(1, int(as_good.sum()) // STARTS)]]
    for start in starts[:STARTS]:
        ends = list(zip(case.low, case.high, strict=True))
        asked = {"type": "ineq", "fun": rows}
        one = descend(lambda x: case.evaluate(x[None])[0][0, bounded], start, bounds=ends, constraints=[asked])
        x = np.clip(one.x, case.low, case.high)
        if np.all(rows(x) >= 0.0):
            best = min(best, float(case.evaluate(x[None])[0][0, bounded]))
    return best


@dataclass(frozen=True, slots=True)
class Measured:
    """One certificate: largest gap [%], whether every bound holds, and what it says of the forms."""

    case: str
    package: str
    points: int
    gap: float
    holds: bool
    forms: str


def measure(case: Case, package: str, seed: int = 1) -> Measured:
    """The certificate of one result, tried against everything that is known."""
    problem = case.plain()
    found = tolevo.certify(problem, PACKAGES[package](case, seed), seeds=1, evaluations=600)
    points = found.points[found.points["feasible"]]
    names = [str(name) for name in points.columns[: len(case.low)]]
    x = points[names].to_numpy(dtype=float)
    drawn = np.random.default_rng(0).uniform(case.low, case.high, (2000, len(case.low)))
    f, _ = case.evaluate(x)
    bound = points["bound"].to_numpy(dtype=float)
    bounded = int(found.bounded.removeprefix("f")) - 1 if np.isfinite(bound).any() else 0
    holds = True
    for at in np.unique(np.linspace(0, len(points) - 1, CHECKED).astype(int)) if len(points) else ():
        if np.isfinite(bound[at]):
            least = least_known(case, bounded, f[at], np.concatenate([x, drawn]))
            holds &= bool(bound[at] <= least + 1e-7 * max(1.0, abs(least)))
    gap = points["gap_percent"].to_numpy(dtype=float)
    most = float(np.nanmax(gap)) if np.isfinite(gap).any() else np.nan
    forms = "; ".join(f"{name}: {form}" for name, form in found.forms.items())
    return Measured(case.name, package, len(points), most, holds, forms)


def main() -> int:
    """Measure all that is installed; 1 where a bound fails, or a form is missed or invented."""
    installed = [name for name in PACKAGES if name == "array" or importlib.util.find_spec(name)]
    measured = [measure(case, package) for case in CASES for package in installed]
    known = {case.name: case.form for case in CASES}
    wrong = [m for m in measured if not m.holds or np.isfinite(m.gap) != known[m.case]]
    for m in measured:
        gap = f"gap {m.gap:.3g} % at most" if np.isfinite(m.gap) else NONE
        print(f"{m.case:32} {m.package:9} {m.points:3} points  {gap:26} {'holds' if m.holds else 'FAILS'}  {m.forms}")
    left = [name for name in PACKAGES if name not in installed]
    print(f"{len(measured)} results, {len(wrong)} wrong; not installed: {', '.join(left) or 'none'}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
