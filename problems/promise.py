"""`[promise]`: what is promised of the yield, and how it is meant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from ..arrays import Array
from ..section import Range, Section

PLUG_IN, PREDICTIVE, ASSURED = "plug_in", "predictive", "assured"
STATEMENTS = (PLUG_IN, PREDICTIVE, ASSURED)
YIELDS = Range(50.0, 100.0, open_high=True)
CONFIDENCES = Range(80.0, 100.0, open_high=True)
"""Below 80 % upper limits of variances are no limits above their posterior means."""
YIELD, PROMISED, ASSURANCE = "yield_percent", "promised_yield_percent", "assurance_percent"
"""Outputs: what estimates say, what the statement promises, how surely the promise is kept."""
DRAWS = 20_000
"""Draws of the posterior that a stated assurance is of."""
AT_ONCE = 2_000_000
"""Yields that are computed at once."""


def normal_yield(z: Array, two_sided: bool) -> Array:
    """Yield [percent] (n,) of a normal output whose limits are z (n,) deviations from the mean."""
    return np.asarray(100.0 * (2.0 * ndtr(z) - 1.0 if two_sided else ndtr(z)))


def assured_percent(kept: Array, draws: int = DRAWS) -> tuple[Array, Array]:
    """An assurance [percent] (n,) by the fractions of draws that keep a promise, and its error."""
    error = np.sqrt(np.maximum(kept * (1.0 - kept), 1.0 / draws) / draws)
    return 100.0 * kept, 100.0 * error


@dataclass(frozen=True, slots=True)
class Promise:
    """A fraction of conforming units, by one of `STATEMENTS`, with a confidence.

    `plug_in`: the yield by the estimates. `predictive`: the expected yield, over the uncertainty
    of the processes. `assured`: a yield that is kept with the confidence. `level_percent` is
    the level of its norm where processes are chosen by samples; None: it is self-calibrated.
    `of` is the output that holds the yield by the estimates.
    """

    yield_percent: float
    statement: str = ASSURED
    confidence_percent: float = 95.0
    level_percent: float | None = None
    of: str = YIELD

    @property
    def fraction(self) -> float:
        """The promised fraction of conforming units."""
        return 0.01 * self.yield_percent

    @property
    def confidence(self) -> float:
        """The confidence as a probability."""
        return 0.01 * self.confidence_percent

    def quantile(self, two_sided: bool) -> float:
        """Standard deviations that must fit between the mean and each limit, of two or of one."""
        return float(ndtri(0.5 * (1.0 + self.fraction) if two_sided else self.fraction))

    @property
    def output(self) -> str:
        """The output that keeps the promise."""
        return self.of if self.statement == PLUG_IN else PROMISED

    def table(self) -> dict[str, Any]:
        """The table that states it."""
        level = {} if self.level_percent is None else {"level_percent": self.level_percent}
        table = {"yield_percent": self.yield_percent, "statement": self.statement}
        return {**table, "confidence_percent": self.confidence_percent, **level}

    def words(self) -> str:
        """The promise in one phrase."""
        return {
            PLUG_IN: f"{self.yield_percent:g} % of the units conform if the estimates are true",
            PREDICTIVE: f"{self.yield_percent:g} % of the units are expected to conform",
            ASSURED: f"at least {self.yield_percent:g} % of the units conform, "
            f"with {self.confidence_percent:g} % confidence",
        }[self.statement]


def read_promise(top: Section, of: str = YIELD) -> Promise | None:
    """The `[promise]` table of a yield; None where there is none, or it is faulty."""
    if "promise" not in top:
        return None
    section = top.section("promise")
    percent = section.number("yield_percent", within=YIELDS)
    statement = section.text("statement", STATEMENTS)
    confidence = section.number("confidence_percent", within=CONFIDENCES)
    level = section.number("level_percent", within=CONFIDENCES)
    if "yield_percent" not in section:
        section.fault("yield_percent", "is missing: state the percentage of units that must conform")
    if "statement" not in section:
        section.fault("statement", f"is missing: state one of {', '.join(STATEMENTS)}")
    section.finish()
    given = {"confidence_percent": confidence, "level_percent": level}
    wrong = any(key in section and value is None for key, value in given.items())
    if percent is None or statement is None or wrong:
        return None
    return Promise(percent, statement, 95.0 if confidence is None else confidence, level, of)
