"""`[costs.<variable>]`: cost curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..declarations import Variable
from ..errors import nearest
from ..models.costs import CostCurve, Table
from ..models.costs.extras import EXTRAS, dearer, read_extras
from ..models.costs.reading import name_of, read_curve
from ..problems.settings import VariableSetting
from ..section import Section


def read_costs(section: Section, defaults: Mapping[str, CostCurve]) -> dict[str, CostCurve]:
    """The curves that the configuration sets; only variables with a cost may have a curve."""
    curves = {name: _read(section.section(name), default) for name, default in defaults.items() if name in section}
    section.accept((*defaults, "scale_assumed", "assumed"))
    section.finish()
    return {name: curve for name, curve in curves.items() if curve is not None}


def _read(section: Section, default: CostCurve) -> CostCurve | None:
    """A curve with its part of a set-up and of inspection, which require a stated curve."""
    added = [key for key in EXTRAS if key in section]
    more = read_extras(section)
    if added and "model" not in section:
        section.fault(added[0], "is added to a stated cost: give its model and coefficients as well")
        section.accept(section.all_keys())
        return None
    curve = read_curve(section, default)
    return None if curve is None else dearer(curve, more)


def narrowed(
    variable: Variable, setting: VariableSetting | None, curve: CostCurve | None
) -> tuple[VariableSetting | None, str]:
    """The setting within the tolerances that a table of costs spans, and a note for the user."""
    stated = setting or VariableSetting()
    if not isinstance(curve, Table) or stated.value is not None:
        return setting, ""
    low, high = _search_range(variable, stated)
    ends = max(low, curve.t[0]), min(high, curve.t[-1])
    if ends == (low, high) or ends[0] >= ends[1]:
        return setting, ""
    unit = f" {variable.unit}".rstrip()
    note = (
        f"costs of {variable.name} are given from {curve.t[0]:g} to {curve.t[-1]:g}{unit}: the search from {low:g} to "
        f"{high:g} is narrowed to {ends[0]:g} to {ends[1]:g}"
    )
    return replace(stated, low=ends[0], high=ends[1]), note


def check_ends(section: Section, variable: Variable, setting: VariableSetting | None, curve: CostCurve | None) -> None:
    """Report a range or value at which the cost is not finite."""
    if curve is None:
        return
    stated = setting or VariableSetting()
    low, high = _search_range(variable, stated)
    ends = {"low": low, "high": high} if stated.value is None else {"value": stated.value}
    for key, end in ends.items():
        with np.errstate(all="ignore"):
            cost = float(curve.cost(np.array([end]))[0])
        if not np.isfinite(cost):
            text = f"must have a finite cost, but {end:g} {variable.unit} costs {cost:g}"
            section.fault(key, f"{text} by its cost curve ({name_of(curve)})")


def _search_range(variable: Variable, setting: VariableSetting) -> tuple[float, float]:
    return (
        variable.low if setting.low is None else setting.low,
        variable.high if setting.high is None else setting.high,
    )


def unknown(name: str, valid: list[str], what: str) -> str:
    """Message for a name that is none of `valid`."""
    return f'"{name}" is not {what}{nearest(name, valid)}; one of {", ".join(valid)}'
