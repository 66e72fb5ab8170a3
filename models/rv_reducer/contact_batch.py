"""A batch of RV reducers on their exact contact: units drawn one by one, measured over a turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from ...arrays import Array, Integers
from ...declarations import Value
from ..inputs.distribution import Distribution
from ..measurable import NO_CHANGES
from .batch_declared import LARGEST
from .population.changed import changed
from .population.design import UnitDesign
from .population.lattice import Lattice, turn_lattice
from .population.sample import BaseSample
from .population.scaled import Scaled
from .population.statistics import Involute
from .population.table import Table
from .population.touch import touch
from .population.unit_basis import UnitBasis, stem

BLOCK = 4096
"""Units drawn in one block: some 20 MB."""
FIXED = 4096
"""Units of the fixed sample that means are taken over."""
COMPARED = 1024
"""Units over which a change of the mean is taken, by common random numbers."""
LAW = 16_384
"""Units of the fixed sample that the law of units is taken from."""
SHIFTED = 12
"""Clearances of the involute stage that each unit of the law is combined with."""
SEEDS = {"means": 1, "law": 2}


class ContactUnits:
    """Units of one allocation, phi_1 + max(0, y) at every position of a turn.

    y is the backlash of the cycloid stage by first contact of all its pins, play of the crank
    bearings inside; phi_1 that of the tighter planet. A unit shows its largest backlash over the
    positions of the turn, or the mean, or that at an angle of the output.
    """

    def __init__(
        self, parameters: Mapping[str, Value], designs: Mapping[str, float], inputs: Mapping[str, Distribution]
    ) -> None:
        laws = {stem(name): law for name, law in inputs.items()}
        self.basis = UnitBasis.from_parameters(parameters, laws, {})
        self.positions = int(float(str(parameters["positions"])))
        self.largest = parameters["measured"] == LARGEST
        self.design: UnitDesign = self.basis.design(designs)
        self.involute: Involute = self.basis.involute(self.design.involute_grade)
        self._shifts: dict[frozenset[tuple[str, float]], float] = {}

    # ---------------------------------------------------------------- units drawn

    def predict(
        self, row: Integers, rng: np.random.Generator, changes: Mapping[str, Array], angles: Array | None
    ) -> Array:
        """Backlash (n,) [arcmin] of rows (n,) by the number of their unit, 0, 1, ...

        `angles` (n,) [deg] are those of the output where each row is a measurement at one angle.
        The errors of a unit depend on its number and `rng` alone, and memory on `BLOCK` alone.
        """
        backlash, order = np.empty(len(row)), np.argsort(row, kind="stable")
        count = int(row.max(initial=-1)) + 1
        lattice = None if angles is None else self._at_angles(angles)
        for start in range(0, count, BLOCK):
            units = min(BLOCK, count - start)
            sample = self._sample(units, rng, "random")
            first, last = np.searchsorted(row[order], [start, start + units])
            for rows in np.split(order[first:last], range(BLOCK, last - first, BLOCK)):
                by_row = _rows(sample, row[rows] - start)
                row_changes = _of_rows(changes, rows)
                if lattice is None or angles is None:
                    cycloid = self._measured(by_row, row_changes)
                else:
                    cycloid = self._measured_at(lattice, angles[rows], by_row, row_changes)
                backlash[rows] = cycloid + self._involute(by_row)
        return backlash

    def _sample(self, units: int, rng: np.random.Generator, kind: Literal["sobol", "random"]) -> BaseSample:
        return BaseSample.draw(self.basis.geometry, units, rng, self.basis.hierarchy, kind)

    def _involute(self, sample: BaseSample) -> Array:
        """phi_1 (n,) [arcmin]."""
        return self.involute.middle + self.involute.half * self.basis.tightest(sample.planets)

    def _measured(
        self, sample: BaseSample, changes: Mapping[str, Array] = NO_CHANGES, design: UnitDesign | None = None
    ) -> Array:
        """Backlash (n,) [arcmin] of the cycloid stage as it is measured over the turn."""
        return (
            np.maximum(self.play(sample, changes, design), 0.0)
            if self.largest
            else np.asarray(np.maximum(self._play(*self._turn, sample, changes, design), 0.0).mean(axis=0))
        )

    def play(
        self, sample: BaseSample, changes: Mapping[str, Array] = NO_CHANGES, design: UnitDesign | None = None
    ) -> Array:
        """The largest (or mean) y (n,) [arcmin] over the turn, below zero: interference."""
        play = self._play(*self._turn, sample, changes, design)
        return np.asarray(play.max(axis=0) if self.largest else play.mean(axis=0))

    def _play(
        self,
        lattice: Lattice,
        table: Table,
        sample: BaseSample,
        changes: Mapping[str, Array],
        design: UnitDesign | None = None,
    ) -> Array:
        """y (positions, n) [arcmin] of the cycloid stage."""
        geometry = self.basis.geometry
        drawn = Scaled.of(geometry, sample, design or self.design)
        units = changed(geometry, drawn, sample, changes)
        backlash = touch(lattice, table, units).cycloid(geometry.output_ratio)
        return np.asarray(backlash, dtype=np.float64)

    def unclipped(self, sample: BaseSample, design: UnitDesign) -> Array:
        """Contribution (n,) [arcmin] of the cycloid stage of units of a design, negative where
        all of the turn interferes; the mean over a turn is never negative.
        """
        return self.play(sample, NO_CHANGES, design) if self.largest else self._measured(sample, NO_CHANGES, design)

    def fixed(self, units: int, seed: int) -> BaseSample:
        """A Sobol sample of units."""
        return self._sample(units, np.random.default_rng(seed), "sobol")

    # ---------------------------------------------------------------- positions

    def _with_table(self, angles: Array) -> tuple[Lattice, Table]:
        lattice = Lattice.of(self.basis.geometry, angles)
        return lattice, Table.of(lattice, self.design.dr_rp, self.design.dr_p)

    @cached_property
    def _turn(self) -> tuple[Lattice, Table]:
        """The positions of a turn."""
        teeth = self.basis.geometry.nominal.cycloid_teeth
        return self._with_table(turn_lattice(self.positions, teeth))

    def _at_angles(self, angles: Array) -> tuple[Array, Lattice, Table]:
        """The different angles [deg] of the output, and the mesh there."""
        different = np.unique(angles)
        teeth = self.basis.geometry.nominal.cycloid_teeth
        return different, *self._with_table(np.deg2rad(different) * teeth)

    def _measured_at(
        self, mesh: tuple[Array, Lattice, Table], angles: Array, sample: BaseSample, changes: Mapping[str, Array]
    ) -> Array:
        """Backlash (n,) [arcmin] of the cycloid stage, each row at an angle of `angles` (n,)."""
        different, lattice, table = mesh
        at, backlash = np.searchsorted(different, angles), np.empty(len(angles))
        for position in np.unique(at):
            rows = np.flatnonzero(at == position)
            row_changes = _of_rows(changes, rows)
            y = self._play(_position(lattice, int(position)), table, _rows(sample, rows), row_changes)
            backlash[rows] = np.maximum(y[0], 0.0)
        return backlash

    # ---------------------------------------------------------------- the population

    def mean(self, changes: Mapping[str, Array] = NO_CHANGES) -> float:
        """Mean [arcmin] over the population at the mean change, over a fixed Sobol sample.

        Changes are compared over the same units, so that their difference has no sampling noise.
        """
        key = frozenset((name, float(np.mean(value))) for name, value in changes.items())
        return self._mean + self._shifted(key) - self._shifted(frozenset())

    def _shifted(self, key: frozenset[tuple[str, float]]) -> float:
        """Mean [arcmin] of the compared units at changes of one value each."""
        if key not in self._shifts:
            changes = {name: np.asarray(value) for name, value in key}
            self._shifts[key] = float(self._measured(self._compared, changes).mean())
        return self._shifts[key]

    @cached_property
    def _mean(self) -> float:
        sample = self.fixed(FIXED, SEEDS["means"])
        return float(self._measured(sample).mean()) + self.involute.mean

    @cached_property
    def _compared(self) -> BaseSample:
        return self.fixed(COMPARED, SEEDS["means"])

    @cached_property
    def law_sample(self) -> Array:
        """Backlash (n,) [arcmin] of units that represent the law of the population.

        Each of `LAW` units of a fixed Sobol sample is combined with `SHIFTED` clearances of the
        involute stage, which is independent of them.
        """
        sample = self.fixed(LAW, SEEDS["law"])
        parts = (sample.part(slice(start, start + BLOCK)) for start in range(0, LAW, BLOCK))
        cycloid = np.concatenate([self._measured(part) for part in parts])
        rng = np.random.default_rng(SEEDS["law"])
        probability = (np.arange(SHIFTED) + rng.random((len(cycloid), SHIFTED))) / SHIFTED
        z = self.basis.planet.quantile(probability)
        return np.asarray((cycloid[:, None] + self.involute.middle + self.involute.half * z).ravel())


def _position(lattice: Lattice, at: int) -> Lattice:
    """The lattice of one of its positions; contacts keep their numbers."""
    position = slice(at, at + 1)
    return replace(
        lattice,
        angles=lattice.angles[position],
        start=lattice.start[position],
        stop=lattice.stop[position],
        directions=lattice.directions[position],
    )


def _rows(sample: BaseSample, units: Integers) -> BaseSample:
    """The units of rows (n,), each row a copy of its unit."""
    if len(units) == sample.units and np.array_equal(units, np.arange(sample.units)):
        return sample
    return sample.part(units)


def _of_rows(changes: Mapping[str, Array], rows: Integers) -> dict[str, Array]:
    """The changes at some of the rows, where they are not the same for all of them."""
    return {name: np.asarray(amount)[rows if np.ndim(amount) else ...] for name, amount in changes.items()}
