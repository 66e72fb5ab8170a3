"""The responses by which runs are compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isnan, nan
from types import MappingProxyType

import numpy as np

from ...algorithms.course import Course
from ...algorithms.exact.bounds import proof, reason
from ...algorithms.exact.solver import closed_form
from ...problems.interfaces import Provable
from ...problems.tolerance_problem import ToleranceProblem
from .yardstick import Yardstick


@dataclass(frozen=True, slots=True)
class Ended:
    """A run that has ended."""

    problem: ToleranceProblem
    course: Course
    measure: Yardstick


def _gap(value: float, bound: float) -> float:
    """Distance of a cost from its bound [%], NaN where there is none."""
    return 100.0 * max(value - bound, 0.0) / abs(bound) if value == value and bound else nan


def _gap_percent(run: Ended) -> float:
    """The gap of the best design for one objective, else the median over the front."""
    front = run.course.front
    if not len(front):
        return nan
    if run.problem.n_obj == 1:
        return _gap(float(front.min()), run.measure.bound)
    columns = dict(zip(run.problem.objectives, front.T, strict=True))
    gap = proof(run.problem, columns, len(front)).gap_percent(columns["cost"])
    return float(np.nanmedian(gap)) if not np.isnan(gap).all() else nan


FORMULAS: MappingProxyType[str, Callable[[Ended], float]] = MappingProxyType(
    {
        "hypervolume_ratio": lambda run: run.measure.box.hypervolume(run.course.front) / run.measure.value,
        "hypervolume": lambda run: run.measure.box.hypervolume(run.course.front),
        "gap_percent": _gap_percent,
        "evaluations_to_99": lambda run: run.course.reached_at[0],
        "cpu_s_to_99": lambda run: run.course.reached_at[1],
        "feasible_fraction": lambda run: run.course.feasible / (run.course.evaluations or nan),
    }
)


def needs_level(names: Iterable[str]) -> bool:
    """Whether a run must know its reference while it runs."""
    return bool({"evaluations_to_99", "cpu_s_to_99"} & set(names))


def compared(name: str, value: float, end: float, measure: Yardstick) -> float:
    """A response of a run that has ended, by its reference, which may have been measured later.

    `value` is what the run itself computed, `end` the last value of its curve.
    """
    if name == "hypervolume_ratio":
        return end / measure.value
    if name == "gap_percent" and len(measure.box.ideal) == 1:
        return _gap(end, measure.bound)
    return value


def unsuitable(name: str, problem: ToleranceProblem) -> str:
    """Why a response has no meaning for a problem, and what to use instead; empty where it has."""
    if name == "hypervolume_ratio" and problem.n_obj == 1:
        return "has no meaning for one objective: use gap_percent"
    if name == "gap_percent":
        text = reason(problem, Provable.of(problem).form())
        return f"cannot be computed ({text}): use hypervolume" if text else ""
    if name in ("hypervolume_ratio", "evaluations_to_99", "cpu_s_to_99"):
        text = _no_exact_front(problem)
        return f"needs the exact front, and {text}: use hypervolume" if text else ""
    return ""


def unknown(name: str, measure: Yardstick) -> str:
    """What is missing for a response after the exact front has been searched."""
    needs_value = name in ("hypervolume_ratio", "evaluations_to_99", "cpu_s_to_99")
    single = len(measure.box.ideal) == 1
    if (needs_value and isnan(measure.value)) or (name == "gap_percent" and single and isnan(measure.bound)):
        return "the exact front of this problem could not be proven: use hypervolume"
    return ""


def _no_exact_front(problem: ToleranceProblem) -> str:
    """Why the exact front is not known, as far as this is known without solving for it."""
    if problem.n_obj > 2:
        return "that of three or more objectives is not known"
    form = closed_form(problem)
    return "" if form is not None and form.exact else "this problem has no exact convex form"
