"""`[costs.<variable>]`: cost curves."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import nearest
from ..models.cost_reading import EXTRAS, add_constant_cost, name_of, read_curve, read_extras, times
from ..models.costs import CostCurve, Table
from ..problems.settings import Money, VariableSetting
from ..section import POSITIVE, Section, Variable


def read_costs(
    section: Section, defaults: Mapping[str, CostCurve], priceable: Collection[str] = ()
) -> dict[str, CostCurve]:
    """The curves that the configuration sets; variables without a default have one only where they are `priceable`."""
    known = {**dict.fromkeys(sorted(priceable)), **defaults}
    curves = {name: _read(section.section(name), default) for name, default in known.items() if name in section}
    section.accept((*known, "scale_assumed", "assumed"))
    section.finish()
    return {name: curve for name, curve in curves.items() if curve is not None}


def _read(section: Section, default: CostCurve | None) -> CostCurve | None:
    """A curve with its part of a set-up and of inspection, which require a stated curve."""
    added = [key for key in EXTRAS if key in section]
    more = read_extras(section)
    if added and "model" not in section:
        section.fault(added[0], "is added to a stated cost: give its model and coefficients as well")
        section.accept(section.all_keys())
        return None
    curve = read_curve(section, default)
    return None if curve is None else add_constant_cost(curve, more)


def narrow_setting(
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


# `currency`, and what of the costs is assumed.


_CURRENCY = re.compile(r"[^\W\d_]{1,8}|[€$£¥]")


def read_currency(top: Section) -> str:
    """`currency = "EUR"`, empty where costs are relative."""
    currency = top.text("currency")
    if currency is None:
        return ""
    if not _CURRENCY.fullmatch(currency):
        top.fault("currency", f'must be the name of a currency, like "EUR", got "{currency}"')
        return ""
    return currency


def read_money(
    top: Section, costs: Mapping[str, CostCurve], defaults: Mapping[str, CostCurve]
) -> tuple[Money, dict[str, CostCurve]]:
    """Currency and assumed curves, and all curves that are in use.

    `defaults` are the curves that it does not state. With a currency they can only be used with
    `[costs] scale_assumed`, the price of one assumed unit.
    """
    section, currency = top.section("costs"), read_currency(top)
    scale = section.number("scale_assumed", within=POSITIVE)
    listed = _read_assumed(section, costs)
    curves = dict(costs)
    assumed = tuple(name for name in defaults if name not in costs)
    if scale is not None and "currency" not in top:
        section.fault("scale_assumed", 'needs a currency, such as currency = "EUR": without it all costs are relative')
    if currency and assumed and scale is None and "scale_assumed" not in section:
        text = f"{len(costs)} of {len(costs) + len(assumed)} costs are stated in {currency}; {', '.join(assumed)}"
        remedy = "state them too, or the price of one assumed unit, [costs] scale_assumed = ..."
        top.fault("currency", f"{text} are assumed in relative units: {remedy}")
    if currency and scale is not None:
        curves |= {name: times(defaults[name], scale) for name in assumed}
    assumed = assumed if currency else ()
    return Money(currency, (*listed, *assumed), scale if currency else None), curves


def _read_assumed(section: Section, costs: Mapping[str, CostCurve]) -> tuple[str, ...]:
    """`assumed = ["pin_radius_um"]`: stated curves that are nevertheless assumptions."""
    names = section.names("assumed") if section.take("assumed") != [] else []
    for name in names or ():
        if name not in costs:
            section.fault("assumed", f'"{name}" has no cost here: state it in [costs.{name}]')
    return tuple(name for name in names or () if name in costs)


def resolved_money(money: Money, tables: dict[str, Any]) -> dict[str, Any]:
    """The tables of a problem with the currency and the names of assumed curves."""
    if not money.currency:
        return tables
    resolved = {"currency": money.currency} | tables
    if money.assumed:
        resolved["costs"] = {"assumed": list(money.assumed)} | dict(tables.get("costs", {}))
    return resolved
