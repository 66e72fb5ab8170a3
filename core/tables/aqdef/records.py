"""What a Q-DAS file holds: characteristics of parts, with limits and values."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime


@dataclass(slots=True)
class Characteristic:
    """One characteristic of one part.

    `values` are in `unit`, None where a value is missing or its attribute says that it is not
    valid; `attributes` (K0002), `times` (K0004) and `batches` (K0006) belong to them. `lower`
    and `upper` are limits, None where there is none. `attributive` characteristics count: their
    values are the numbers of faults in samples of `sizes`.
    """

    part: str = ""
    part_number: str = ""
    name: str = ""
    number: str = ""
    nominal: float | None = None
    lower: float | None = None
    upper: float | None = None
    unit: str = ""
    attributive: bool = False
    values: list[float | None] = field(default_factory=list)
    attributes: list[int] = field(default_factory=list)
    times: list[datetime | None] = field(default_factory=list)
    batches: list[str] = field(default_factory=list)
    sizes: list[int | None] = field(default_factory=list)
    keys: dict[str, str] = field(default_factory=dict)
    part_keys: dict[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """What the characteristic is called."""
        return self.name or self.number
