"""Result records of units as a population, and of the inputs behind a difference."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PopulationLine:
    """One line of the comparison of simulated and measured units.

    `model` is "before" or "after" (with the effects in it), `aspect` "location", "spread", "shape",
    "mixture", "trend" or "lots", `statistic` what of it. `low` and `high` are the 90 % interval of
    `difference` (nan where the statistic is never negative), `chance` the size that it reaches by
    chance in any of the lines, `would_show` the size that is detected nine times out of ten;
    `enough` is false where the units are too few to conclude that nothing differs.
    """

    model: str
    output: str
    aspect: str
    statistic: str
    unit: str
    simulated: float
    measured: float
    difference: float
    low: float
    high: float
    chance: float
    would_show: float
    verdict: str
    enough: bool = True

    @property
    def differs(self) -> bool:
        """Whether measured and simulated units differ in it."""
        return self.verdict == "differs"

    def __str__(self) -> str:
        return (
            f"{self.statistic} {self.simulated:.4g} simulated, {self.measured:.4g} measured {self.unit}".rstrip()
            + f": {self.verdict}"
        )


@dataclass(frozen=True, slots=True)
class InputChange:
    """The change of one input that would alone explain a difference.

    `amount` is in `unit`, a factor for a widening without a unit; `share_of_tolerance` is the
    fraction of the half-width of its zone; all are nan where an excluded input would need more than 10
    of them. `distance` is twice the log likelihood by which it
    explains the data worse than the best. `parts` is how many measured parts would show it,
    `readings` how many units like these would distinguish it from the best (0: none would, or not
    known).
    """

    input: str
    amount: float
    low: float
    high: float
    unit: str
    share_of_tolerance: float
    distance: float
    excluded_because: str = ""
    parts: int = 0
    readings: int = 0


@dataclass(frozen=True, slots=True)
class Attribution:
    """Which inputs may be behind a difference; `effect` names those that it would stand for.

    `kind` is "shift", "widening", "trend", "bias" or "gain", `verdict` "attributed" (to the one
    input), "cannot tell" (between the inputs) or "none".
    """

    effect: str
    output: str
    kind: str
    inputs: tuple[str, ...]
    verdict: str
    candidates: tuple[InputChange, ...]
    text: str

    def __str__(self) -> str:
        return self.text
