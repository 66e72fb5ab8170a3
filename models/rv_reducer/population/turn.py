"""A turn of rigid units of one design: the backlash of the cycloid stage at every position."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ....arrays import Array, Single
from ..contact.contact import Engine
from ..contact.geometry import ContactGeometry
from .design import UnitDesign
from .gradient import Slopes, pull_back
from .lattice import Lattice, turn_lattice
from .sample import BaseSample, Hierarchy
from .scaled import Scaled
from .table import COLUMNS, Table
from .touch import Touch, touch


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Positions of a turn, a base sample and its slopes, which all designs have in common."""

    lattice: Lattice
    sample: BaseSample
    slopes: Slopes
    engine: Engine = "auto"

    @classmethod
    def draw(
        cls,
        geometry: ContactGeometry,
        positions: int,
        units: int,
        rng: np.random.Generator,
        hierarchy: Hierarchy | None = None,
        engine: Engine = "auto",
    ) -> Population:
        """A population of `units` at `positions` of a turn of the output."""
        lattice = Lattice.of(geometry, turn_lattice(positions, geometry.nominal.cycloid_teeth))
        sample = BaseSample.draw(geometry, units, rng, hierarchy)
        return cls(lattice, sample, Slopes.of(geometry, sample), engine)

    @property
    def units(self) -> int:
        """Number of units."""
        return self.sample.units

    def alike(self) -> Slopes:
        """Slopes by errors that are the same in all units: every standardised error is 1."""
        sample = self.sample
        ones = {name: np.ones_like(z) for name, z in sample.z.items()}
        return Slopes.of(self.lattice.geometry, replace(sample, z=ones))

    def turn(self, design: UnitDesign) -> Turn:
        """Units built to a design, over the turn."""
        geometry = self.lattice.geometry
        table = Table.of(self.lattice, design.dr_rp, design.dr_p)
        units = Scaled.of(geometry, self.sample, design)
        contact = touch(self.lattice, table, units, self.engine)
        return Turn(self, design, table, units, contact, contact.cycloid(geometry.output_ratio))


@dataclass(frozen=True, eq=False)
class Turn:
    """Units of one design over a turn.

    `play` (positions, units) [arcmin] is the backlash y of the cycloid stage at the carrier, play
    of the crank bearings included; below zero the unit interferes there.
    """

    population: Population
    design: UnitDesign
    table: Table
    units: Scaled
    touch: Touch
    play: Single

    @cached_property
    def by_circle(self) -> Single:
        """Derivative of `play` by the pin-circle radius [arcmin/um], (positions, units): that of
        the contacts that touch.
        """
        radial = self.table.values[:, COLUMNS.index("radial")] / self.population.lattice.geometry.output_ratio
        return np.asarray(radial[self.touch.ahead] - radial[self.touch.behind], dtype=np.float32)

    def slopes(self, weight: Array, errors: Slopes | None = None) -> Array:
        """Derivatives of sum(weight y), weight (positions, units), by `gradient.NAMES`.

        `errors` replace the standardised errors of the population.
        """
        drawn = self.population
        standardised = errors or drawn.slopes
        return pull_back(drawn.lattice, self.table, self.touch, standardised, weight, drawn.engine)
