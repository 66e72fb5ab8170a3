"""The promise of `pose_accuracy`: machines that keep both limits at every pose of the ring.

A state of the processes scales the standard deviations that are known by samples. The error
of a mean moves all machines of a process alike; it counts by the variance that it adds, which is
the same to second order.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from ...declarations import number
from ..interfaces import Differentiable
from ..process_problem import ProcessProblem, Shortfall
from ..promise import PROMISED
from ..settings import Settings
from .outputs import BOTH, BOUNDS, LIMITED, UNITS

SURE = 1e-12
"""Least fraction of machines beyond a limit that is distinguished from none."""
STEPS = 14
"""Halvings of the range in which a search begins."""
STEP = 1e-3
"""Relative step of a standard deviation for the slope of a promised yield."""


class PromisingPoses(ProcessProblem, Differentiable):
    """Machines whose standard deviations are not as the samples say."""

    promised_of: ClassVar[str] = BOTH

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.declaration = replace(self.declaration, sampled=self.promises_by_samples)

    @cached_property
    @abstractmethod
    def squares(self) -> Mapping[str, Array]:
        """Squared effect per squared unit of each variable, (poses or 1, variables), by output."""

    @abstractmethod
    def over_machines(self, designs: Array, names: Iterable[str]) -> dict[str, Array]:
        """Outputs (n,) over machines of full designs (n, all), with their errors."""

    def shortfall(self, design: Array, scales: Array, shifts: Array, searching: bool = False) -> Shortfall:
        """Shortfall of the fraction of machines within both limits, as normal quantiles."""
        outputs = self.over_machines(self._at(design, scales, shifts), [BOTH])
        z = ndtri(np.clip(0.01 * outputs[BOTH], SURE, 1.0 - SURE))
        bell = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
        error = float(np.median(0.01 * outputs[f"{BOTH}_error"] / np.maximum(bell, 1e-6)))
        return Shortfall(self._promised_quantile - z, error)

    @property
    def _promised_quantile(self) -> float:
        """Standard normal quantile of the promised fraction."""
        return float(ndtri(self.stated_promise.fraction))

    def _at(self, design: Array, scales: Array, shifts: Array) -> Array:
        """Full designs (q, all) at states (q, k) of the processes."""
        designs = np.repeat(design[None, :], len(scales), axis=0)
        columns = [self.names.index(name) for name in self.known]
        designs[:, columns] *= np.hypot(scales, shifts)
        return designs

    def coordinates(self, scales: Array, shifts: Array) -> Array:
        return np.hypot(scales, shifts) - 1.0

    def steepness(self, design: Array, searching: bool) -> tuple[Array, Array]:
        """By what each process adds to the variances, over the variances that the limits allow."""
        columns = [self.names.index(name) for name in self.known]
        total = np.zeros(len(columns))
        for name, bound in zip(LIMITED, BOUNDS, strict=True):
            added = self.squares[f"{name}_{UNITS[name]}"] * design**2
            worst = added[int(np.argmax(added.sum(axis=1)))]
            total += worst[columns] / number(self.settings.parameters[bound.name]) ** 2
        return total, np.zeros_like(total)

    def yield_at(self, design: Array, scale: Array, shift: Array, searching: bool) -> float:
        designs = self._at(design, scale[None, :], shift[None, :])
        return float(self.over_machines(designs, [BOTH])[BOTH][0])

    def starts(self) -> Array:
        """Equal fractions of all search ranges that just keep the promise, and half of them."""
        if not self.promises_by_samples:
            return super().starts()
        fraction = self._fraction(lambda design: float(self.promised_yields(design[None, :], True)[0]))
        return np.stack([self._along(fraction), self._along(0.5 * fraction)])

    def _along(self, fraction: float) -> Array:
        """The full design (all,) at equal fractions of all search ranges, by their logarithms."""
        return np.asarray(self.complete((self.xl * (self.xu / self.xl) ** fraction)[None, :])[0])

    def _fraction(self, yields: Callable[[Array], float]) -> float:
        """The fraction of the ranges at which a yield just keeps the promise."""
        near, far = 0.0, 1.0
        for _ in range(STEPS):
            fraction = 0.5 * (near + far)
            kept = yields(self._along(fraction)) >= self.stated_promise.yield_percent
            near, far = (fraction, far) if kept else (near, fraction)
        return near

    @cached_property
    def _expecting(self) -> float:
        """How far along the worst direction the yield is the expected one, where the estimates just
        keep what is promised.
        """
        none = np.ones(len(self.known)), np.zeros(len(self.known))
        design = self._along(self._fraction(lambda design: self.yield_at(design, *none, True)))
        wanted, worst = float(self.expected_yields(design[None, :], False)[0]), self.worst(design, True)
        radii = np.linspace(-1.0, 1.0, 21)
        yields = [self.yield_at(design, *worst.at(float(radius)), True) for radius in radii]
        return float(np.interp(-wanted, -np.array(yields), radii))

    def promised_slopes(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the promised yield, by differences on one sample."""
        if not self.promises_by_samples:
            return {}
        slopes = np.zeros_like(designs)
        for at, v in enumerate(self.variables):
            if v.name not in self.fixed and len(designs):
                ends = [designs.copy() for _ in range(2)]
                ends[0][:, at] *= 1.0 + STEP
                ends[1][:, at] *= 1.0 - STEP
                up, down = (self.promised_yields(end, searching=True) for end in ends)
                slopes[:, at] = (up - down) / (2.0 * STEP * designs[:, at])
        return {PROMISED: slopes}

    def expected_yields(self, designs: Array, searching: bool) -> Array:
        if not searching:
            z = [self._promised_quantile - self.verdict(design).shortfalls for design in designs]
            return np.array([100.0 * float(np.mean(ndtr(design_z))) for design_z in z])
        radius = self._expecting if self.known else 0.0
        return np.array([self.yield_at(design, *self.worst(design, True).at(radius), True) for design in designs])
