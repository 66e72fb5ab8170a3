"""Problems whose yield has no closed form: a promise is tested by draws of the posterior.

In a search a promised yield is that of the most unfavourable processes that the samples allow
(`worst_process`). At a reported point the units themselves are evaluated at a few draws of the
posterior, a quadratic function is fitted to them, and all draws decide: the promised yield is that
of the processes along the worst direction that are as unfavourable as the confidence requires.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from ..arrays import Array, Flags
from .draws import Draws
from .promise import ASSURED, assured_percent
from .response import Response, evaluations
from .with_promise import WithPromise
from .worst_process import Worst

SOFTEST, HARDEST = -2.0, 6.0
"""Range along the worst direction in which the processes of the confidence are sought."""
MOST_VERDICTS = 64
"""Most verdicts that are stored."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """By how much the promised fraction misses its limit, (q,) at q states of the processes; at
    most 0 where it is kept. `slopes` (q, d) are by scales and by the shifts that count, where
    known; `error` is the standard error of a value.
    """

    values: Array
    error: float
    slopes: Array | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """The results of a design over the draws, in percent, and the shortfall of each draw."""

    promised: float
    assurance: float
    error: float
    shortfalls: Array


class ProcessProblem(WithPromise):
    """A problem that evaluates its units for any state of its processes.

    A state is a scale of each known standard deviation, and an error of each mean in standard
    deviations by the estimates, in the order of `known`.
    """

    @abstractmethod
    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        """The shortfall of a full design (all,) at states (q, k)."""

    @abstractmethod
    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        """Derivatives (k,) of the shortfall by scales and shifts where the estimates are true."""

    @abstractmethod
    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        """The yield [percent] of a full design (all,) at one state (k,)."""

    @abstractmethod
    def expected_yields(self, designs: Array, searching: bool) -> Array:
        """The yield [percent] (n,) that is expected over the posterior."""

    @cached_property
    def shifting(self) -> Flags:
        """Which means (k,) may be off; by default none."""
        return np.zeros(len(self.known), dtype=bool)

    def coordinates(self, scales: Array, shifts: Array) -> Array:
        """Coordinates (q, d) of states (q, k), of which the shortfall is a smooth function."""
        return np.hstack([scales - 1.0, shifts[:, self.shifting]])

    def worst(self, design: Array, searching: bool) -> Worst:
        """The worst direction of the processes of a full design (all,)."""
        steep = self.steepness(design, searching)
        return Worst.of(list(self.known.values()), *steep, self.stated_promise.confidence)

    def promised_yields(self, designs: Array, searching: bool) -> Array:
        if self.stated_promise.statement != ASSURED:
            return self.expected_yields(designs, searching)
        if not searching:
            return np.array([self.verdict(design).promised for design in designs])
        return np.array([self.unfavourable_yield(design) for design in designs])

    def unfavourable_yield(self, design: Array) -> float:
        """The yield [percent] of a full design (all,) at the worst state, as a search sees it."""
        return self.yield_at(design, *self.worst(design, True).at(1.0), True)

    def assurances(self, designs: Array) -> tuple[Array, Array]:
        verdicts = [self.verdict(design) for design in designs]
        assurance, error = np.array([(verdict.assurance, verdict.error) for verdict in verdicts]).reshape(-1, 2).T
        return assurance, error

    @cached_property
    def _posterior(self) -> Draws:
        """Draws of the processes, which all designs share."""
        return Draws.of(list(self.known.values()), [(self.settings.seed, at) for at in range(len(self.known))])

    @cached_property
    def _verdicts(self) -> OrderedDict[bytes, Verdict]:
        return OrderedDict()

    def verdict(self, design: Array) -> Verdict:
        """The verdict of the draws on a full design (all,)."""
        key = design.tobytes()
        if key not in self._verdicts:
            self._verdicts[key] = self._by_draws(design)
            while len(self._verdicts) > MOST_VERDICTS:
                self._verdicts.popitem(last=False)
        return self._verdicts[key]

    def _by_draws(self, design: Array) -> Verdict:
        if not self.known:
            return self._without_doubt(design)
        drawn = self._posterior
        x = self.coordinates(np.sqrt(drawn.variance), drawn.error)
        fitted = slice(0, evaluations(x.shape[1], self._has_slopes))
        tried = self.shortfall(design, np.sqrt(drawn.variance[fitted]), drawn.error[fitted])
        response, worst = Response.of(x[fitted], tried.values, tried.slopes), self.worst(design, False)

        def along(radius: float) -> float:
            scale, shift = worst.at(radius)
            return float(response(self.coordinates(scale[None, :], shift[None, :]))[0])

        values = response(x)
        wanted = float(np.quantile(values, self.stated_promise.confidence, method="higher"))
        scale, shift = worst.at(_reached(along, wanted))
        there = self.shortfall(design, scale[None, :], shift[None, :])
        # the evaluated units correct the fitted response where it decides
        values += float(there.values[0]) - wanted
        assurance, error = assured_percent(np.array([float(np.mean(values <= 0.0))]), drawn.count)
        doubt = np.hypot(response.rms, there.error)
        reach = 50.0 * float(np.mean(values <= doubt) - np.mean(values <= -doubt))
        return Verdict(
            self.yield_at(design, scale, shift, False), float(assurance[0]), float(np.hypot(error[0], reach)), values
        )

    _has_slopes = False
    """Whether `shortfall` gives slopes."""

    def _without_doubt(self, design: Array) -> Verdict:
        """The verdict on a design whose processes are all known."""
        nothing = np.ones(0)
        shortfall = self.shortfall(design, nothing[None, :], nothing[None, :])
        assurance = 100.0 * float(shortfall.values[0] <= 0.0)
        return Verdict(self.yield_at(design, nothing, nothing, False), assurance, 0.0, shortfall.values)


def _reached(along: Callable[[float], float], wanted: float) -> float:
    """Where along the worst direction a value is reached, or the nearest end."""
    ends = [along(end) for end in (SOFTEST, HARDEST)]
    if not ends[0] < wanted < ends[1]:
        return SOFTEST if wanted <= ends[0] else HARDEST
    return float(scipy.optimize.brentq(lambda b: along(b) - wanted, SOFTEST, HARDEST, xtol=1e-4))
