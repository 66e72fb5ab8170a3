"""Effects of a change of a toleranced input on units on the exact contact, for a batch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...units import ARCMIN, UM
from ..inputs import Empirical
from ..propagation import ClippedSum, Term
from ..sources import Source, Sources
from .contact_batch import ContactUnits
from .involute import lever
from .population.design import ERRORS
from .population.sample import BaseSample
from .sources import flank_clearance

UNITS = 2048
"""Units of the fixed sample, which is built again for every change."""
SEED = 3
STEP = 0.5
"""Change [um] over which a mean is differentiated, by common random numbers."""
CENTRED = ("circle_offset", "bore", "crank_phase")
"""Errors without a mid-limit: they have no sign, or no mean."""
IN_MRAD = "crank_phase"
BASIS = "a shift of an input by the derivative of the mean on the contact, a wider zone by a new sample of units"


@dataclass(frozen=True)
class ContactSources:
    """The inputs of contact units; their total is a sample, not a sum."""

    units: ContactUnits

    @cached_property
    def sample(self) -> BaseSample:
        """The fixed sample."""
        return self.units.fixed(UNITS, SEED)

    def sources(self) -> Sources:
        """phi_1 free, the cycloid stage clipped as a whole; sums in arc minutes."""
        involute = self.units.involute
        flank = Term(involute.planet, np.array([involute.middle]), np.array([involute.half]))
        total = ClippedSum((flank,), (self._cycloid(),))
        inputs = (*(self._source(error) for error in ERRORS), self._flank())
        return Sources(total, 1.0, inputs, self.widened, BASIS)

    def widened(self, source: Source, factor: float) -> Term:
        """The cycloid stage with the zone of one of its inputs `factor` as wide."""
        error = source.name.removesuffix("_um").removesuffix("_mrad")
        widths = dict(self.units.design.half_width)
        return self._cycloid(half_width=widths | {error: widths[error] * factor})

    def _cycloid(self, **changed: object) -> Term:
        values = self._values(**changed)
        return Term(Empirical(tuple(values.tolist())), np.zeros(1), np.ones(1))

    def _values(self, **changed: object) -> Array:
        """Contribution (n,) [arcmin] of the cycloid stage before it is cut off at zero."""
        design = replace(self.units.design, **changed)  # type: ignore[arg-type]
        return self.units.unclipped(self.sample, design)

    def _source(self, error: str) -> Source:
        design = self.units.design
        unit = "mrad" if error == IN_MRAD else "um"
        from_zero = error == "crank_bearing"
        part = "clearance of the crank-arm bearings" if from_zero else f"{error.replace('_', ' ')} error"
        half = design.width(error) * (0.5 if from_zero else 1.0)
        return Source(
            f"{error}_{unit}",
            unit,
            part,
            half,
            self._slope(error),
            clipped=True,
            at=0,
            law=self.units.basis.hierarchy.of(error),
            from_zero=from_zero,
        )

    def _slope(self, error: str) -> float:
        """Derivative [arcmin/um] of the mean by the middle of the zone."""
        design = self.units.design
        if error in CENTRED or error == "pin_position":
            return 0.0
        if error == "crank_bearing":
            wide = design.width(error) + 2.0 * STEP
            values = self._values(half_width=dict(design.half_width) | {error: wide})
        else:
            values = self._values(mid=dict(design.mid) | {error: design.middle(error) + STEP})
        return float(values.mean() - self._sample_mean) / STEP

    @cached_property
    def _sample_mean(self) -> float:
        return float(self._values().mean())

    def _flank(self) -> Source:
        """The clearance of the involute stage."""
        basis, involute = self.units.basis, self.units.involute
        arm = lever(basis.stage, basis.geometry.nominal)
        per = UM / arm / ARCMIN if basis.geared else 0.0
        half = involute.half / per if per else 0.0
        return flank_clearance(half, per, involute.planet, involute.middle / max(involute.half, 1e-300))
