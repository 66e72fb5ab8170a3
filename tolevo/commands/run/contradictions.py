"""Limits that contradict each other or cannot be proven, reported before a run begins."""

from __future__ import annotations

import numpy as np

from ...algorithms.exact.bounds import bounds_within, convex_pieces, restrict_form, row_limits, upper_limit
from ...algorithms.exact.choices import least_cost
from ...algorithms.exact.front import tightest
from ...errors import Fault
from ...models.stack.mechanism import Law
from ...problems.forms import Form
from ...problems.limits import keeps, loosened
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array

HALVINGS = 40
HALF = 50.0
"""Yield [percent] below which a quantile is not convex."""


def contradictions(problem: ToleranceProblem, algorithm: str) -> list[Fault]:
    """A fault for each limit that another limit forbids, with the least achievable value.

    Proven by the convex form: an upper limit on the cost against limits on requirements, and
    requirements against each other where their deviations compensate.
    """
    faults = _below_half(problem) if algorithm == "exact" else []
    form = problem.form() if problem.limits else None
    if form is None:
        return faults + _below_bound(problem)
    if form.also or len(problem.limits) < 2:
        return faults
    limits = row_limits(problem, form)
    faults += _further_costs_beyond(problem, form, limits)
    used, most = np.isfinite(limits), upper_limit(problem, "cost")
    if not np.any(used) or (not np.isfinite(most) and form.correlation is None):
        return faults
    form, limits = convex_pieces(restrict_form(form, used)), limits[used]
    bound = float(least_cost(form, loosened(limits)[None, :]).bound[0])
    if np.isinf(bound):
        return faults + _impossible(form, limits)
    if not keeps(bound, most):
        return faults + _too_expensive(form, limits, most, bound)
    return faults


def _further_costs_beyond(problem: ToleranceProblem, form: Form, limits: Array) -> list[Fault]:
    """Limits on further costs that the other limits forbid."""
    faults = []
    for name in problem.cost_names[1:] if np.any(np.isfinite(limits)) else ():
        most, alone = upper_limit(problem, name), problem.weighted_form(form, {name: 1.0})
        if not np.isfinite(most) or alone is None:
            continue
        least = float(bounds_within(alone, loosened(limits)[None, :])[0])
        if np.isfinite(least) and not keeps(least, most):
            text = (
                f"at most {most:g} cannot be kept with the other limits, within which the least {name} is {least:.6g}"
            )
            faults.append(Fault(f"limits.{name}", f"{text}; raise one of them"))
    return faults


def _below_bound(problem: ToleranceProblem) -> list[Fault]:
    """The limit on the cost where a bound that needs no form shows that the other limits contradict it."""
    most, known = upper_limit(problem, "cost"), problem.cost_bound()
    if not np.isfinite(most) or known is None or known.missing:
        return []
    least = float(known.least_costs({}, 1)[0])
    text = f"at most {most:g} cannot be kept with the other limits, within which the least cost is {least:.4g} or more"
    return [Fault("limits.cost", f"{text} ({known.statement}); raise one of them")] if least > loosened(most) else []


def _below_half(problem: ToleranceProblem) -> list[Fault]:
    """Yields below one half of requirements that `exact` is to prove."""
    measured = problem.measured if isinstance(problem, Stack) else ()
    lawful = {requirement.name("yield_percent") for requirement in measured if isinstance(requirement.law, Law)}
    return [
        Fault(
            f"limits.{limit.name}",
            f"asks for {limit.low:g} % of the units: a quantile below one half is not convex and cannot be proven; ask "
            "for 50 % or more, or take another algorithm than exact, whose run is not proven",
        )
        for limit in problem.limits
        if limit.name in lawful and 0.0 < limit.low < HALF
    ]


def _too_expensive(form: Form, limits: Array, most: float, bound: float) -> list[Fault]:
    """Faults of the limit on the cost, and of the limits on requirements that it contradicts."""
    forms = [restrict_form(form, np.arange(len(limits)) == at) for at in range(len(limits))]
    least_costs = [float(least_cost(alone, limits[None, at : at + 1]).bound[0]) for at, alone in enumerate(forms)]
    rows = [at for at, cost in enumerate(least_costs) if cost > most] or list(range(len(limits)))
    names = list(dict.fromkeys(form.outputs[at] for at in rows))
    requirements = ", ".join(f"limits.{name}" for name in names)
    least = max([bound, *(least_costs[at] for at in rows)])
    faults = [
        Fault(
            "limits.cost",
            f"at most {most:g} and {requirements} contradict each other: with them "
            f"kept the least cost is {least:.6g}; raise one of them",
        )
    ]
    for name in names:
        indices = [at for at in rows if form.outputs[at] == name]
        reach = max(_reached(forms[at], most) for at in indices)
        text = (
            f"at most {limits[indices[0]]:g} and limits.cost, at most {most:g}, contradict each "
            f"other: with the cost kept the least {name} is {reach:.6g}, with this limit the "
            f"least cost is {max(least_costs[at] for at in indices):.6g}"
        )
        faults.append(Fault(f"limits.{name}", text))
    return faults


def _reached(form: Form, most: float) -> float:
    """The least value of a requirement within a cost, without all other requirements."""
    low, high = float(tightest(form)[0]), float(tightest(form)[0])
    step = max(abs(high), 1e-12)
    while least_cost(form, np.array([[high]])).cost[0] > most and step < 1e12 * max(abs(low), 1.0):
        high, step = high + step, 2.0 * step
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        affordable = least_cost(form, np.array([[middle]])).cost[0] <= most
        low, high = (low, middle) if affordable else (middle, high)
    return high


def _impossible(form: Form, limits: Array) -> list[Fault]:
    """Limits on requirements that no tolerances keep together."""
    least, names = tightest(form), ", ".join(dict.fromkeys(f"limits.{n}" for n in form.outputs))
    return [
        Fault(
            f"limits.{name}",
            f"no tolerances keep {names} together: alone the least {name} is "
            f"{least[at]:.6g}, the limit is {limits[at]:g}; raise one of them",
        )
        for at, name in enumerate(form.outputs)
        if name not in form.outputs[:at]
    ]
