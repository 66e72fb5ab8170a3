"""`[[part.machine]]` and `[[variables.NAME.machine]]`: machines from and to their tables."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...section import POSITIVE, Range, Section
from ..costs import CostCurve, Reciprocal
from ..costs.extras import NOT_NEGATIVE, Setup, read_setup
from .curves import GoodPartsByLimit
from .machine import GUARD, SIDES, Inspection, Machine, Rework

TIGHTEST, LOOSEST = 0.5, 4.0
"""Limits of inspection from and to which it is searched, in standard deviations of the readings."""
LEAST_YIELD = 1e-3
"""Share of good parts below which a limit of inspection makes no sense."""


@dataclass(frozen=True, slots=True)
class Way:
    """A machine used in one way: inspected at +-t from `low` to `high`, or without inspection at
    its natural half-width; cost of a good part against t.
    """

    machine: Machine
    low: float
    high: float

    @property
    def label(self) -> str:
        """Name of the way."""
        return self.machine.name + (", inspected" if self.machine.inspection else "")

    @property
    def curve(self) -> CostCurve:
        """Cost of a good part."""
        if self.machine.inspection is None:
            return Reciprocal(self.machine.price, 0.0)
        return GoodPartsByLimit(self.machine)


@dataclass(frozen=True, slots=True)
class Offer:
    """A machine as a table states it. The price of `machine` has its share of the `setup`.

    `low` and `high` are the limits of inspection that are searched, `required` says that parts are
    never used without inspection, `assumed` what the table leaves open.
    """

    machine: Machine
    price: float
    low: float = 0.0
    high: float = 0.0
    setup: Setup | None = None
    required: bool = False
    assumed: str = field(default="", compare=False)

    def ways(self) -> tuple[Way, ...]:
        """With and without inspection, as far as the table allows it."""
        natural = self.machine.natural
        bare = Way(replace(self.machine, inspection=None), natural, natural)
        if self.machine.inspection is None:
            return (bare,)
        inspected = Way(self.machine, self.low, self.high)
        return (inspected,) if self.required else (bare, inspected)

    def table(self) -> dict[str, Any]:
        """The table that states it."""
        one, given = self.machine, self.machine.inspection
        found: dict[str, Any] = {"name": one.name, "sigma": one.sigma, "mean": one.mean,
                                 "price": self.price}  # fmt: skip
        if self.setup is not None:
            found["setup"] = self.setup.table()
        if given is None:
            return found
        inspection: dict[str, Any] = {"price": given.price, "u": given.u, "guard": given.guard,
                                      "scrap": given.scrap, "required": self.required}  # fmt: skip
        if given.rework is not None:
            again = given.rework
            inspection["rework"] = {"price": again.price, "success": again.success,
                                    "side": again.side}  # fmt: skip
        return found | {"t_min": self.low, "t_max": self.high, "inspection": inspection}


def read_offers(
    section: Section, unit: str, ends: tuple[float | None, float | None] = (None, None)
) -> tuple[Offer, ...] | None:
    """The `machine` tables of a part or variable in `unit`; None after a fault.

    `ends` are limits of inspection for machines that state none.
    """
    return section.named_items("machine", lambda own, name: _offer(own, name, unit, ends))


def _offer(
    own: Section, name: str, unit: str, ends: tuple[float | None, float | None]
) -> Offer | None:
    sigma, mean = own.number("sigma", unit, POSITIVE), own.number("mean", unit)
    price, setup = own.number("price", within=NOT_NEGATIVE), read_setup(own)
    if "sigma" not in own:
        own.fault("sigma", "is missing: the standard deviation of what the machine makes")
    if "price" not in own:
        own.fault("price", "is missing: what a part costs on the machine")
    if "cost" in own:
        own.take("cost")
        own.fault("cost", "is no key of a machine, whose scatter does not follow t: give price, or "
                  "state a process")  # fmt: skip
    inspection = _inspection(own, unit) if "inspection" in own else None
    limits = [own.number(key, unit, POSITIVE) for key in ("t_min", "t_max")]
    if "inspection" not in own:
        for key in ("inspection", "t_min", "t_max"):
            if key in own:
                own.fault(key, "is the limit of an inspection, and the machine has none: state "
                          "inspection = { price = ... }, or leave it out")  # fmt: skip
    if sigma is None or price is None or ("inspection" in own and inspection is None):
        return None
    if ("mean" in own and mean is None) or ("setup" in own and setup is None):
        return None
    whole = price + (setup.per_part if setup else 0.0)
    machine = Machine(name, sigma, whole, mean or 0.0, inspection and inspection[0])
    if inspection is None:
        return Offer(machine, price, setup=setup)
    return _searched(own, Offer(machine, price, setup=setup, required=inspection[1]), limits, ends,
                     unit)  # fmt: skip


def _searched(
    own: Section, offer: Offer, limits: list[float | None],
    ends: tuple[float | None, float | None], unit: str,
) -> Offer | None:  # fmt: skip
    """The offer with the limits of inspection that are searched."""
    one = offer.machine
    usual = (one.guard_band + TIGHTEST * one.reading + max(0.0, abs(one.mean) - one.reading),
             one.guard_band + LOOSEST * one.reading + abs(one.mean))  # fmt: skip
    stated = [ends[at] if limits[at] is None else limits[at] for at in (0, 1)]
    low, high = (usual[at] if (end := stated[at]) is None else end for at in (0, 1))
    open_ = [key for key, end in zip(("t_min", "t_max"), stated, strict=True) if end is None]
    assumed = ""
    if open_:
        assumed = (f"machine {one.name} is inspected at {low:.4g} to {high:.4g} {unit}; "
                   f"{' and '.join(open_)} not given")  # fmt: skip
    if low >= high:
        own.fault("t_min" if "t_min" in own else "t_max", f"must leave a range: limits of "
                  f"inspection from {low:g} to {high:g} {unit}")  # fmt: skip
        return None
    if low <= one.guard_band:
        own.fault("t_min" if "t_min" in own else "inspection.u",
                  f"leaves nothing between the guard bands: limits of {low:g} {unit} less "
                  f"{one.guard_band:.4g} at each (guard x u)")  # fmt: skip
        return None
    share = float(one.passed(np.array([low]))[0])
    if not share >= LEAST_YIELD:
        own.fault("mean" if one.mean else "t_min", f"lets {100.0 * share:.2g} % of the parts pass "
                  f"at the tightest limits ({low:g} {unit}): correct the mean or widen "
                  "t_min")  # fmt: skip
        return None
    return replace(offer, low=low, high=high, assumed=assumed)


def _inspection(own: Section, unit: str) -> tuple[Inspection, bool] | None:
    """The inspection, and whether it is required."""
    table = own.section("inspection")
    price, u = table.number("price", within=NOT_NEGATIVE), table.number("u", unit, NOT_NEGATIVE)
    guard, scrap = table.number("guard", within=NOT_NEGATIVE), table.flag("scrap")
    required = table.flag("required")
    if "price" not in table and isinstance(own.take("inspection"), dict):
        table.fault("price", "is missing: what the inspection of a part costs")
    rework = _rework(table) if "rework" in table else None
    table.known(("rework",))
    table.finish()
    values = {"price": price, "u": u, "guard": guard, "scrap": scrap, "required": required,
              "rework": rework}  # fmt: skip
    if price is None or any(key in table and value is None for key, value in values.items()):
        return None
    found = Inspection(price, u or 0.0, GUARD if guard is None else guard,
                       True if scrap is None else scrap, rework)  # fmt: skip
    return found, bool(required)


def _rework(table: Section) -> Rework | None:
    own = table.section("rework")
    price = own.number("price", within=NOT_NEGATIVE)
    success = own.number("success", within=Range(0.0, 1.0, open_low=True))
    side = own.text("side", SIDES)
    needed = {"price": "what the rework of a part costs",
              "side": "upper, lower or both: which rejected parts can be reworked"}  # fmt: skip
    for key, what in needed.items():
        if key not in own and isinstance(table.take("rework"), dict):
            own.fault(key, f"is missing: {what}")
    own.finish()
    if price is None or side is None or ("success" in own and success is None):
        return None
    return Rework(price, 1.0 if success is None else success, side)
