"""What a drawing and a price need to know of every variable: `tolerances.json`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...declarations import Kind, Variable
from ...models.costs import CostCurve, Table
from ...models.costs.reading import curve_table
from ...problems.interfaces import Drawing
from ...problems.tolerance_problem import ToleranceProblem
from ...units import converted
from .steps import half_widths, size_mm


def tolerances(
    problem: ToleranceProblem, rules: Mapping[str, str], values: Mapping[str, Mapping[float, str]]
) -> tuple[dict[str, Any], ...]:
    """A record per variable: what it is, its range, what can be ordered, what it costs.

    `rules` say how a variable is rounded, `values` what can be ordered of it with the names of
    grades. Each of several alternative processes has a range and a cost curve, in the order of the
    labels of its variable.
    """
    free = {v.name for v in problem.free}
    return tuple(
        _record(problem, v, v.name in free, rules.get(v.name, "fixed"), values.get(v.name, {}))
        for v in problem.variables
    )


def _record(
    problem: ToleranceProblem, v: Variable, free: bool, rule: str, values: Mapping[float, str]
) -> dict[str, Any]:
    nominal, mid = Drawing.of(problem).zone(v.name)
    low, high = problem.interval(v.name) if free else (problem.fixed[v.name],) * 2
    return {
        "name": v.name,
        "unit": v.unit,
        "meaning": v.meaning,
        "kind": v.kind.name.lower(),
        "free": free,
        "integer": v.integer,
        "labels": list(v.labels),
        "low": low,
        "high": high,
        "nominal": nominal,
        "mid": mid if v.kind is Kind.HALF_WIDTH else None,
        "um": _um(v) if v.tolerance else None,
        "rule": rule,
        "orderable": [
            [value, name] for value, name in sorted(values.items()) if low * (1 - 1e-9) <= value <= high * (1 + 1e-9)
        ],
        "grades": _grades(problem, v),
        "process": f"{v.name.removesuffix('_t')}_process",
        "costs": [_cost_curve(curve) | {"count": count} for curve, count in Drawing.of(problem).curves_of(v.name)],
        **Drawing.of(problem).drawn(v.name),
    }


def _cost_curve(curve: CostCurve) -> dict[str, Any]:
    """A curve as a page computes with it; a table also has the least cost up to each entry."""
    table = curve_table(curve)
    return table | {"cost_at": list(curve.least)} if isinstance(curve, Table) else table


def _um(v: Variable) -> float | None:
    """One micrometre in the unit of a variable; None where that is no length."""
    try:
        return float(converted(1.0, "um", v.unit)) if v.unit else None
    except ValueError:
        return None


def _grades(problem: ToleranceProblem, v: Variable) -> list[list[Any]]:
    """ISO 286 grades with their half-widths in the unit of a variable of known nominal size."""
    size = size_mm(problem, v)
    return [] if size is None else [[grade, half] for grade, half in half_widths(v, size).items()]
