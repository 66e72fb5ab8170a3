"""Machines offered for a tolerance, with and without inspection of their parts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..section import POSITIVE, Range, Section
from .capability import PartSample, read_sample
from .cost_reading import NOT_NEGATIVE, Setup, read_setup
from .costs import CostCurve, Reciprocal
from .machines import GUARD, SIDES, GoodPartsByLimit, Inspection, Machine, Rework

PLUG_IN = "the standard deviation of the sample counts as that of all later parts"
"""The assumption where a scatter is that of measured parts."""


@dataclass(frozen=True, slots=True)
class Way:
    """A machine with its parts inspected at +-t from `low` to `high`, or without inspection at its
    natural half-width; cost of a good part against t.
    """

    machine: Machine
    low: float
    high: float

    @property
    def label(self) -> str:
        """The name of the machine, and whether its parts are inspected."""
        return self.machine.name + (", inspected" if self.machine.inspection else "")

    @property
    def curve(self) -> CostCurve:
        """Cost of a good part."""
        if self.machine.inspection is None:
            return Reciprocal(self.machine.price, 0.0)
        return GoodPartsByLimit(self.machine)


@dataclass(frozen=True, slots=True)
class Offer:
    """A machine as a table states it. The price of `machine` includes its fraction of the `setup`.

    `low` and `high` are the limits of inspection that are searched; with `required` parts are never
    used without inspection; `assumed` has the assumptions where the table is silent. `sample` are
    the measured parts, where the table states scatter and mean by these.
    """

    machine: Machine
    price: float
    low: float = 0.0
    high: float = 0.0
    setup: Setup | None = None
    required: bool = False
    assumed: str = field(default="", compare=False)
    sample: PartSample | None = field(default=None, compare=False)

    def ways(self) -> tuple[Way, ...]:
        """With and without inspection, as far as the table allows it."""
        natural = self.machine.natural
        without = Way(replace(self.machine, inspection=None), natural, natural)
        if self.machine.inspection is None:
            return (without,)
        inspected = Way(self.machine, self.low, self.high)
        return (inspected,) if self.required else (without, inspected)

    def table(self) -> dict[str, Any]:
        """The table that states it."""
        machine = self.machine
        stated: dict[str, Any] = {"name": machine.name, "price": self.price}
        if self.sample is None:
            stated |= {"sigma": machine.sigma, "mean": machine.mean}
        else:
            stated["measured"] = dict(self.sample.stated)
        if self.setup is not None:
            stated["setup"] = asdict(self.setup)
        if machine.inspection is None:
            return stated
        inspection = asdict(machine.inspection)
        rework = inspection.pop("rework")
        inspection |= {"required": self.required} | ({"rework": rework} if rework else {})
        return stated | {"t_min": self.low, "t_max": self.high, "inspection": inspection}


def ways_of(offers: Iterable[Offer]) -> tuple[Way, ...]:
    """Each machine, with and without inspection, in the order of the choice."""
    return tuple(way for offer in offers for way in offer.ways())


def samples_of(offers: Iterable[Offer]) -> tuple[tuple[str, PartSample], ...]:
    """Names of machines with their measured parts, where there are any."""
    return tuple((offer.machine.name, offer.sample) for offer in offers if offer.sample is not None)


def departures_from_normality(offers: Iterable[Offer], owner: str) -> tuple[str, ...]:
    """Departures of measured parts of machines from a single stable normal process."""
    return tuple(text for name, sample in samples_of(offers) for text in sample.departures(f"{owner}, machine {name}"))


# Reads `[[part.machine]]` and `[[variables.NAME.machine]]`.


TIGHTEST, LOOSEST = 0.5, 4.0
"""Range of the searched limits of inspection, in standard deviations of the measurements."""
LEAST_YIELD = 1e-3
"""Fraction of good parts below which a limit of inspection is refused."""


@dataclass(frozen=True, slots=True)
class Owner:
    """The feature made by a machine: its `unit`, and nominal and mid-limit for measured parts.

    `ends` are limits of inspection for machines that state none.
    """

    unit: str
    ends: tuple[float | None, float | None] = (None, None)
    nominal: float | None = None
    mid: float = 0.0


def read_offers(section: Section, owner: Owner) -> tuple[Offer, ...] | None:
    """The `machine` tables of a part or variable; None after a fault."""
    return section.named_items("machine", lambda table, name: _offer(table, name, owner))


def _offer(table: Section, name: str, owner: Owner) -> Offer | None:
    price, setup = table.number("price", within=NOT_NEGATIVE), read_setup(table)
    scatter, sample = _scatter(table, owner)
    if "price" not in table:
        table.fault("price", "is missing: the cost of a part on the machine")
    if "cost" in table:
        table.take("cost")
        table.fault("cost", "is no key of a machine, whose scatter does not depend on t: state price, or a process")
    inspection = _inspection(table, owner.unit) if "inspection" in table else None
    limits = [table.number(key, owner.unit, POSITIVE) for key in ("t_min", "t_max")]
    if "inspection" not in table:
        for key in ("t_min", "t_max"):
            if key in table:
                table.fault(key, "is a limit of inspection, and no inspection is stated: state it, or remove this key")
    if scatter is None or price is None or ("inspection" in table and inspection is None):
        return None
    if "setup" in table and setup is None:
        return None
    with_setup = price + (setup.per_part if setup else 0.0)
    machine = Machine(name, scatter[0], with_setup, scatter[1], inspection and inspection[0])
    required, assumed = bool(inspection and inspection[1]), _sample_assumptions(name, sample)
    offer = Offer(machine, price, setup=setup, required=required, assumed=assumed, sample=sample)
    return offer if inspection is None else _with_searched_inspection(table, offer, limits, owner)


def _scatter(table: Section, owner: Owner) -> tuple[tuple[float, float] | None, PartSample | None]:
    """Standard deviation and mean of a machine's parts, stated or from measured parts."""
    sigma, mean = table.number("sigma", owner.unit, POSITIVE), table.number("mean", owner.unit)
    if "measured" not in table:
        table.accept(("measured",))
        if "sigma" not in table:
            table.fault("sigma", "is missing: the standard deviation of the parts, or measured = { file = ... }")
        faulty = sigma is None or ("mean" in table and mean is None)
        return (None if faulty or sigma is None else (sigma, mean or 0.0)), None
    stated = [key for key in ("sigma", "mean") if key in table]
    for key in stated:
        table.fault(key, "is stated in addition to measured, from which it follows: remove one of them")
    sample = read_sample(table, owner.unit, owner.nominal, owner.mid, follows=False)
    if sample is None or stated:
        return None, None
    return (sample.knowledge.std, sample.offset), sample


def _sample_assumptions(name: str, sample: PartSample | None) -> str:
    """Assumptions where the table of measured parts is silent."""
    return "; ".join(f"machine {name}: {why}" for why in sample.assumed.values()) if sample else ""


def _with_searched_inspection(table: Section, offer: Offer, limits: list[float | None], owner: Owner) -> Offer | None:
    """The offer with the limits of inspection that are searched."""
    machine, unit = offer.machine, owner.unit
    usual = (
        machine.guard_band + TIGHTEST * machine.measured_std + max(0.0, abs(machine.mean) - machine.measured_std),
        machine.guard_band + LOOSEST * machine.measured_std + abs(machine.mean),
    )
    stated = [other if limit is None else limit for limit, other in zip(limits, owner.ends, strict=True)]
    low, high = (other if limit is None else limit for limit, other in zip(stated, usual, strict=True))
    open_ = [key for key, limit in zip(("t_min", "t_max"), stated, strict=True) if limit is None]
    assumed = [offer.assumed] if offer.assumed else []
    if open_:
        assumed.append(
            f"machine {machine.name} is inspected at {low:.4g} to {high:.4g} {unit}; {' and '.join(open_)} not given"
        )
    if low >= high:
        table.fault(
            "t_min" if "t_min" in table else "t_max",
            f"must leave a range of limits of inspection, got {low:g} to {high:g} {unit}",
        )
        return None
    if low <= machine.guard_band:
        table.fault(
            "t_min" if "t_min" in table else "inspection.u",
            f"leaves no range between the guard bands: the limits are {low:g} {unit}, "
            f"and the guard band (guard x u) at each is {machine.guard_band:.4g} {unit}",
        )
        return None
    passed = float(machine.passed(np.array([low]))[0])
    if not passed >= LEAST_YIELD:
        table.fault(
            "mean" if machine.mean else "t_min",
            f"lets only {100.0 * passed:.2g} % of the parts pass at the tightest limits ({low:g} {unit}): "
            "correct the mean, or widen t_min",
        )
        return None
    return replace(offer, low=low, high=high, assumed="; ".join(assumed))


def _inspection(machine_table: Section, unit: str) -> tuple[Inspection, bool] | None:
    """The inspection, and whether it is required."""
    table = machine_table.section("inspection")
    price, u = table.number("price", within=NOT_NEGATIVE), table.number("u", unit, NOT_NEGATIVE)
    guard, scrap = table.number("guard", within=NOT_NEGATIVE), table.flag("scrap")
    required = table.flag("required")
    if "price" not in table and isinstance(machine_table.take("inspection"), dict):
        table.fault("price", "is missing: the cost of inspecting a part")
    rework = _rework(table) if "rework" in table else None
    table.accept(("rework",))
    table.finish()
    values = {"price": price, "u": u, "guard": guard, "scrap": scrap, "required": required, "rework": rework}
    if price is None or any(key in table and value is None for key, value in values.items()):
        return None
    guard = GUARD if guard is None else guard
    return Inspection(price, u or 0.0, guard, scrap is not False, rework), bool(required)


def _rework(table: Section) -> Rework | None:
    rework_table = table.section("rework")
    price = rework_table.number("price", within=NOT_NEGATIVE)
    success = rework_table.number("success", within=Range(0.0, 1.0, open_low=True))
    side = rework_table.text("side", SIDES)
    needed = {
        "price": "the cost of reworking a part",
        "side": "upper, lower or both: which rejected parts can be reworked",
    }
    for key, meaning in needed.items():
        if key not in rework_table and isinstance(table.take("rework"), dict):
            rework_table.fault(key, f"is missing: {meaning}")
    rework_table.finish()
    if price is None or side is None or ("success" in rework_table and success is None):
        return None
    return Rework(price, 1.0 if success is None else success, side)
