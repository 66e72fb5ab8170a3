"""What the units of a gap analysis were simulated as: the drawing, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass

from .declarations import Value


@dataclass(frozen=True, slots=True)
class Dimension:
    """A nominal dimension, or another number of the geometry."""

    name: str
    value: Value
    unit: str
    meaning: str

    def __str__(self) -> str:
        shown = f"{self.value:g}" if isinstance(self.value, int | float) else str(self.value)
        return f"{self.name} {shown}"


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A variable of the allocation that the units were built to.

    `value` is what `kind` says; `low` and `high` are the limits of the zone, None where it has
    none. `distribution` is empty where the variable does not scatter.
    """

    variable: str
    unit: str
    kind: str
    value: float
    low: float | None
    high: float | None
    distribution: str

    def __str__(self) -> str:
        if self.low is None or self.high is None:
            return f"{self.variable} {self.value:.6g}"
        return f"{self.variable} {self.low:.6g}..{self.high:.6g}"


@dataclass(frozen=True, slots=True)
class Drawing:
    """Geometry, zones, distributions and effects of the simulated units, each with its source.

    `assumed` says what is the model's default because the configuration does not name it, and how
    to name it; empty where everything is named.
    """

    model: str
    geometry_from: str
    allocation_from: str
    geometry: tuple[Dimension, ...]
    zones: tuple[DrawnZone, ...]
    effects: tuple[str, ...] = ()
    assumed: str = ""

    def lines(self) -> tuple[str, ...]:
        """The same for the terminal, what is assumed first."""
        texts = [self.assumed] if self.assumed else []
        geometry = ", ".join(map(str, self.geometry))
        texts.append(f"simulated: {self.model}, {geometry}; from {self.geometry_from}")
        zones, laws = ", ".join(map(str, self.zones)), ", ".join(self.distributions())
        if zones:
            text = f"built to: {zones}; from {self.allocation_from}"
            texts.append(f"{text}; distribution: {laws}" if laws else text)
        if self.effects:
            texts.append(f"effects in the simulated units: {', '.join(self.effects)}")
        return tuple(texts)

    def distributions(self) -> tuple[str, ...]:
        """The distribution of every input; a single entry where it is the same for all."""
        laws = {zone.variable: zone.distribution for zone in self.zones if zone.distribution}
        if len(set(laws.values())) == 1:
            return (next(iter(laws.values())),)
        return tuple(f"{name} {law}" for name, law in laws.items())
