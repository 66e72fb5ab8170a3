"""The base sample of a population: standardised errors of every source, drawn once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ....arrays import Array
from ...inputs import Distribution, Uniform
from ..contact.geometry import ContactGeometry

PIN_ERRORS = ("pin_position", "pin_hole_radius", "pin_radius")
DISC_ERRORS = ("equidistance", "shift")
ONCE = ("pitch", "runout")
ECCENTRIC_ERRORS = ("eccentricity", "crank_bearing", "crank_phase", "bore_radial", "bore_tangential")


@dataclass(frozen=True, slots=True)
class Hierarchy:
    """Dependence between the errors of one unit.

    `share_pins` and `share_discs` are the fractions of variance that the pins, and the discs, of
    one unit have in common; both are assumptions. `inputs` has distributions by name of the error,
    uniform where not named.
    """

    share_pins: float = 0.0
    share_discs: float = 0.0
    inputs: Mapping[str, Distribution] = field(default_factory=dict)

    def of(self, error: str) -> Distribution:
        """Distribution of an error over its zone; both directions of a bore have the same."""
        return self.inputs.get(error.removesuffix("_radial").removesuffix("_tangential"), Uniform())


@dataclass(frozen=True, slots=True, eq=False)
class BaseSample:
    """Standardised errors of n units: error = mid-limit + half-width z.

    `z` by name of the error, units last: (n,) of errors of the whole unit, (pins, n) of pins,
    (discs, n) of discs, (cranks, discs, n) of eccentrics and bores; `phase` [rad] likewise of
    `pitch`, `runout` (discs, n) and `circle_offset` (n,). `planets` (planets + 1, n) are standard
    normal: the common part of all planets, then the part of each planet. `hierarchy` has the laws
    that the errors were drawn from.
    """

    units: int
    z: Mapping[str, Array]
    phase: Mapping[str, Array]
    planets: Array
    hierarchy: Hierarchy = field(default_factory=Hierarchy)

    @classmethod
    def draw(
        cls,
        geometry: ContactGeometry,
        units: int,
        rng: np.random.Generator,
        hierarchy: Hierarchy | None = None,
        kind: Literal["sobol", "random"] = "sobol",
    ) -> BaseSample:
        """A sample of `units`; sources common to a unit take the first Sobol dimensions."""
        source = _Source(geometry, units, rng, kind)
        laws = hierarchy or Hierarchy()
        z = {"pin_circle_radius": laws.of("pin_circle_radius").quantile(source.unit())}
        z["circle_offset"] = laws.of("circle_offset").quantile(source.unit())
        phase = {"circle_offset": 2.0 * np.pi * source.unit()}
        discs, pins = (geometry.discs,), (geometry.pins,)
        common = {
            name: ndtri(source.unit())
            for names, fraction in ((DISC_ERRORS, laws.share_discs), (PIN_ERRORS, laws.share_pins))
            for name in names
            if fraction > 0.0
        }
        for name in DISC_ERRORS:
            u = _shared(source.of(discs), common.get(name), laws.share_discs)
            z[name] = laws.of(name).quantile(u)
        for name in ONCE:
            z[name] = laws.of(name).quantile(source.of(discs))
            phase[name] = 2.0 * np.pi * source.of(discs)
        for name in ECCENTRIC_ERRORS:
            z[name] = laws.of(name).quantile(source.of((geometry.cranks, geometry.discs)))
        planets = ndtri(source.of((geometry.cranks + 1,)))
        for name in PIN_ERRORS:
            u = _shared(source.of(pins), common.get(name), laws.share_pins)
            z[name] = laws.of(name).quantile(u)
        return cls(units, z, phase, planets, laws)

    def part(self, chosen: slice | NDArray[np.int64]) -> BaseSample:
        """Some of the units."""
        z = {name: value[..., chosen] for name, value in self.z.items()}
        phase = {name: value[..., chosen] for name, value in self.phase.items()}
        planets = self.planets[..., chosen]
        return BaseSample(planets.shape[-1], z, phase, planets, self.hierarchy)


def _shared(u: Array, common: Array | None, fraction: float) -> Array:
    """Probabilities coupled by a Gaussian copula with a `fraction` of common variance."""
    if common is None:
        return u
    return np.asarray(ndtr(np.sqrt(fraction) * common + np.sqrt(1.0 - fraction) * ndtri(u)))


class _Source:
    """Probabilities in (0, 1), dimension after dimension."""

    def __init__(self, geometry: ContactGeometry, units: int, rng: np.random.Generator, kind: str) -> None:
        most = 10 + 3 * geometry.pins + 8 * geometry.discs
        most += 6 * geometry.cranks * geometry.discs + geometry.cranks
        if kind == "sobol":
            power = max(0, int(units - 1).bit_length())
            drawn = scipy.stats.qmc.Sobol(most, scramble=True, rng=rng).random_base2(power)[:units]
        else:
            drawn = rng.random((units, most))
        tiny = 1e-12
        self._probabilities = np.clip(drawn.T, tiny, 1.0 - tiny)
        self._at = 0

    def unit(self) -> Array:
        """Probabilities (n,) of the next dimension."""
        return np.asarray(self.of((1,))[0])

    def of(self, shape: tuple[int, ...]) -> Array:
        """Probabilities (*shape, n) of the next dimensions."""
        size = int(np.prod(shape))
        drawn = self._probabilities[self._at : self._at + size]
        self._at += size
        return np.asarray(drawn.reshape(*shape, -1))
