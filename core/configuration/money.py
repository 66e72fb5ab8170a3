"""`currency`, and what of the costs is assumed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..models.costs import CostCurve
from ..models.costs.extras import times
from ..problems.settings import Money
from ..section import POSITIVE, Section

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
    listed = _listed(section, costs)
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


def _listed(section: Section, costs: Mapping[str, CostCurve]) -> tuple[str, ...]:
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
