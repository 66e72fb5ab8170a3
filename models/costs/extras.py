"""Costs of a part in addition to its manufacture: its fraction of a set-up, its inspection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...section import POSITIVE, Range, Section
from .curve import CostCurve
from .table import Table

NOT_NEGATIVE = Range(low=0.0)
EXTRAS = ("setup", "inspection")
"""Keys of the costs that are added to that of making a part."""


@dataclass(frozen=True, slots=True)
class Setup:
    """A set-up at a `price` for a `lot` of so many parts."""

    price: float
    lot: int

    @property
    def per_part(self) -> float:
        """Cost per part of the lot."""
        return self.price / self.lot


def read_setup(section: Section) -> Setup | None:
    """`setup = { price = 120, lot = 50 }`, None where there is none or it is at fault."""
    if "setup" not in section:
        section.accept(("setup",))
        return None
    table = section.section("setup")
    price, lot = table.number("price", within=NOT_NEGATIVE), table.integer("lot", Range(low=1))
    for key, meaning in (("price", "the price of a set-up"), ("lot", "the number of parts in a lot")):
        if key not in table and isinstance(section.take("setup"), dict):
            table.fault(key, f"is missing: {meaning}")
    table.finish()
    return None if price is None or lot is None else Setup(price, lot)


def read_extras(section: Section) -> float:
    """What `setup` and `inspection = { price = 0.4 }` add to the cost of a part; 0 without them."""
    setup, inspection = read_setup(section), 0.0
    if "inspection" in section:
        table = section.section("inspection")
        price = table.number("price", within=POSITIVE)
        if "price" not in table:
            table.fault("price", "is missing: the cost of inspecting a part")
        for key in ("u", "guard", "scrap", "rework", "required"):
            if key in table:
                table.take(key)
                table.fault(key, "needs a scatter that does not depend on t: state sigma in a machine")
        table.finish()
        inspection = price or 0.0
    section.accept(("inspection",))
    return inspection + (setup.per_part if setup else 0.0)


def read_extras_by(section: Section, keys: Sequence[str]) -> dict[str, float]:
    """The same for each of `keys`, for which the price of a set-up may differ:
    `setup = { price = { IT6 = 240, IT7 = 120 }, lot = 50 }`.
    """
    stated = section.take("setup")
    prices = stated.get("price") if isinstance(stated, dict) else None
    if not isinstance(prices, dict):
        return dict.fromkeys(keys, read_extras(section))
    table, setup = section.section("setup").section("price"), section.of("setup", stated)
    price_of = {key: table.number(key, within=NOT_NEGATIVE) for key in keys}
    lot = setup.integer("lot", Range(low=1))
    setup.accept(("price",))
    if "lot" not in setup:
        setup.fault("lot", "is missing: the number of parts in a lot")
    for key in keys:
        if key not in table:
            table.fault(key, "is missing: state the set-up of each grade, or a single price for all")
    for part in (table, setup):
        part.finish()
    inspection = read_extras(section.having("setup", {"price": 0.0, "lot": 1}))
    return {key: inspection + (price or 0.0) / (lot or 1) for key, price in price_of.items()}


def dearer(curve: CostCurve, more: float) -> CostCurve:
    """The curve with a constant added."""
    if more == 0.0:
        return curve
    if isinstance(curve, Table):
        return replace(curve, cost_at=tuple(cost + more for cost in curve.cost_at))
    return replace(curve, a=curve.a + more)  # type: ignore[type-var,attr-defined]


def times(curve: CostCurve, factor: float) -> CostCurve:
    """The curve with every cost multiplied by `factor`."""
    if isinstance(curve, Table):
        return replace(curve, cost_at=tuple(factor * cost for cost in curve.cost_at))
    scaled = {key: factor * getattr(curve, key) for key in ("a", "b", "c") if hasattr(curve, key)}
    return replace(curve, **scaled)  # type: ignore[type-var]
