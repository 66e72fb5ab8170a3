"""Machines offered for a tolerance, with and without inspection of their parts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from ..capability import PartSample
from ..costs import CostCurve, Reciprocal
from ..costs.extras import Setup
from .curves import GoodPartsByLimit
from .machine import Machine

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


def samples_of(offers: Iterable[Offer]) -> tuple[tuple[str, PartSample], ...]:
    """Names of machines with their measured parts, where there are any."""
    return tuple((offer.machine.name, offer.sample) for offer in offers if offer.sample is not None)


def departures(offers: Iterable[Offer], owner: str) -> tuple[str, ...]:
    """Departures of measured parts of machines from a single stable normal process."""
    return tuple(text for name, sample in samples_of(offers) for text in sample.departures(f"{owner}, machine {name}"))
