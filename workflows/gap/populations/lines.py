"""Lines of statistics of measured and simulated batches, and whether these differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ....arrays import Array
from ....gap_population_records import PopulationLine
from .statistics import Look, values_of

LEVEL = 0.9
DETECTED = 0.9
"""Probability of detecting a difference of the stated size."""
COMMON = 0.05
DIFFERS, NOT_DETECTED = "differs", "no difference detected; one of {} would have been"
DRAWN = 500_000
"""Approximate number of units of all simulated batches together."""
AGAIN = 200
"""Number of batches drawn from the measured one for the intervals."""


def batches(count: int) -> int:
    """The number of batches of `count` units that are simulated."""
    return int(np.clip(DRAWN // count, 300, 1000))


def rarely(values: Array, rate: float) -> float:
    """The value that a fraction `rate` of simulated values (b,) exceeds. The tail is extrapolated
    as exponential, as that of a likelihood ratio is; that of a normal falls more steeply.
    """
    common = float(np.quantile(values, 1.0 - COMMON))
    beyond = values[values > common] - common
    more = float(beyond.mean()) if len(beyond) else 0.0
    return common + more * max(float(np.log(COMMON / rate)), 0.0)


@dataclass(frozen=True)
class Compared:
    """Measured units `x` (n,) and batches `drawn` (b, n) of the model, in the same order.

    `offset`, by name of the statistic, is added to both where they are shown.
    """

    looks: tuple[Look, ...]
    x: Array
    drawn: Array
    rate: float
    least: int

    def lines(
        self, model: str, output: str, offset: dict[str, float], rng: np.random.Generator
    ) -> tuple[PopulationLine, ...]:
        """A line for each statistic; a difference exceeds what any line reaches by chance."""
        simulated = values_of(self.looks, self.drawn)
        measured = {name: float(value[0]) for name, value in values_of(self.looks, self.x[None]).items()}
        middle = {name: float(np.mean(value)) for name, value in simulated.items()}
        limits = self._limits(simulated, middle)
        drawn = rng.integers(0, len(self.x), (AGAIN, len(self.x)))
        again = values_of(tuple(look for look in self.looks if look.signed), self.x[drawn])
        values = {name: (middle[name], measured[name], limits[name], simulated[name]) for name in middle}
        return tuple(
            self._line(look, model, output, offset, *values[look.name], again.get(look.name)) for look in self.looks
        )

    def _limits(self, simulated: dict[str, Array], middle: dict[str, float]) -> dict[str, float]:
        """The deviation of each statistic from its mean by chance, for all together (Sidak)."""
        rate = 1.0 - (1.0 - self.rate) ** (1.0 / len(self.looks))
        limits = {}
        for look in self.looks:
            far = simulated[look.name] - middle[look.name]
            limits[look.name] = rarely(np.abs(far) if look.signed else far, rate)
        return limits

    def _line(
        self,
        look: Look,
        model: str,
        output: str,
        offset: dict[str, float],
        simulated: float,
        measured: float,
        limit: float,
        drawn: Array,
        again: Array | None,
    ) -> PopulationLine:
        difference = measured - simulated
        low = high = float("nan")
        if again is not None:
            half = float(ndtri(0.5 + 0.5 * LEVEL) * np.std(again))
            low, high = difference - half, difference + half
        beyond = abs(difference) > limit if look.signed else difference > limit
        shows = limit + float(ndtri(DETECTED) * np.std(drawn))
        text = DIFFERS if beyond else NOT_DETECTED.format(f"{shows:.3g} {look.unit}".rstrip())
        enough = beyond or len(self.x) >= self.least
        text = text if enough else f"cannot tell with n = {len(self.x)}"
        what, by = (model, output, look.aspect, look.name, look.unit), offset.get(look.name, 0.0)
        numbers = (simulated + by, measured + by, difference, low, high, limit, shows)
        return PopulationLine(*what, *numbers, text, bool(enough))
