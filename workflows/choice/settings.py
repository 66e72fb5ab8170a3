"""What `[choice]` and `[rounding]` say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...problems.settings import Bound

IT_GRADES = "IT"
PREFERRED = "R20"
RULES = (IT_GRADES, PREFERRED)
"""Rounding by name: ISO 286 grades at the nominal size, preferred numbers of ISO 3."""

Step = str | float | tuple[float, ...]
"""One of `RULES`, a step whose multiples can be ordered, or the list of what can be."""


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """How a point is chosen; `weights` of objectives (equal where empty) need not add up to one.

    `limits` are what the cheapest point must keep in addition to those of the run, `budget` is the
    most that the best point may cost, and `steps` says by variable what can be ordered.
    `roughness_share` is the most that Ra may be of the width of a zone, None where it is not
    stated.
    """

    weights: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, Bound] = field(default_factory=dict)
    budget: float | None = None
    steps: Mapping[str, Step] = field(default_factory=dict)
    roughness_share: float | None = None
