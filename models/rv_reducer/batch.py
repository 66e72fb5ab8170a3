"""The model `rv_batch`: a batch of RV reducers drawn one by one, by the sum of the three stages or on the exact
contact, as a test bench measures them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import raise_all
from ...journal import recall_arrays
from ...section import Array, Integers, Kind, Output, Parameter, Value, Variable
from ...units import ARCMIN, UM
from ..inputs import Distribution, Empirical, Uniform
from ..measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Role, Source, Sources, ranks_of_units
from ..propagation import ClippedSum, Convolution, Term
from ..propagation.moments import PowerSums
from . import declared
from .backlash import BacklashModel, flank_clearance, sources_of
from .contact import declared as contact
from .cycloid import LINEAR_ERRORS
from .geometry import lever
from .population.contact import touch
from .population.errors import Lattice, Scaled, Table, change_units, turn_lattice
from .population.units import (
    BEARING_PLAY_FACTOR,
    ERRORS,
    PITCH_SPECTRUM,
    BaseSample,
    Involute,
    UnitBasis,
    UnitDesign,
    stem,
)

MODEL = "model"
CONTACT, DOCUMENT = "contact", "document"
LARGEST, MEAN = "max", "mean"
_NOT_PRINTED = "no document prints it"


def _fraction(name: str, meaning: str) -> Parameter:
    return Parameter(
        name,
        0.0,
        "",
        f"fraction of the variance of {meaning} that is common to a unit; no value is the worst case",
        _NOT_PRINTED,
        assumed=True,
        low=0.0,
        high=1.0,
    )


_OF_BATCHES: tuple[Parameter, ...] = (
    Parameter(
        MODEL,
        CONTACT,
        "",
        "model of a unit: the exact contact of its pins and discs over a turn (contact), or "
        "document B's closed form phi_1 + max(0, phi_2) + phi_3, one number per unit (document)",
        "",
        choices=(CONTACT, DOCUMENT),
    ),
    Parameter(
        "positions",
        61,
        "",
        "positions of a turn of the output at which a unit is measured; used by the contact only",
        "",
        low=1,
        high=100_003,
    ),
    Parameter(
        "measured",
        LARGEST,
        "",
        "which backlash of a unit over these positions is reported: the largest, or the mean; used by the contact only",
        "",
        choices=(LARGEST, MEAN),
    ),
    Parameter(
        "involute_stage",
        True,
        "",
        "whether there is an involute stage before the cycloid stage; used by the contact only",
        "",
    ),
    _fraction("share_pins", "the errors of pins and their holes"),
    _fraction("share_discs", "equidistance and shift of the discs"),
    PITCH_SPECTRUM,
    BEARING_PLAY_FACTOR,
    *(parameter for parameter in contact.PARAMETERS if parameter.name in ("discs", "cranks")),
)
_NAMES = {parameter.name for parameter in declared.PARAMETERS}
PARAMETERS = (*declared.PARAMETERS, *(parameter for parameter in _OF_BATCHES if parameter.name not in _NAMES))


def _disc_to_disc_variable(name: str, value: float, unit: str, meaning: str) -> Variable:
    return Variable(
        name,
        unit,
        Kind.HALF_WIDTH,
        0.0,
        10.0,
        f"{meaning}; used by the contact only",
        value,
        valid_low=0.0,
        valid_high=1000.0,
        random=True,
        assumed="no document lists this error",
    )


GEOMETRY = (
    MODEL,
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "discs",
    "cranks",
)
"""Parameters by which reducers are distinguished."""
OF_THE_BENCH = (MODEL, "positions", "measured")
"""Parameters of the measurement, independent of the design of the unit."""

VARIABLES: tuple[Variable, ...] = (
    *declared.VARIABLES,
    _disc_to_disc_variable("circle_offset_um", 3.0, "um", "offset of the pin circle from the axis of the carrier"),
    _disc_to_disc_variable("bore_um", 2.0, "um", "position of the crank bores in a disc, either direction"),
    _disc_to_disc_variable("crank_phase_mrad", 2.0 / 1.3, "mrad", "phase of each journal of a crankshaft"),
)
"""The variables of document B, and errors between discs at the values of `rv_reducer`."""


# A batch of RV reducers on their exact contact: units drawn one by one, measured over a turn.


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
                row_changes = _changes_of_rows(changes, rows)
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
        units = change_units(geometry, drawn, sample, changes)
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
            row_changes = _changes_of_rows(changes, rows)
            y = self._play(_position(lattice, int(position)), table, _rows(sample, rows), row_changes)
            backlash[rows] = np.maximum(y[0], 0.0)
        return backlash

    # ---------------------------------------------------------------- the population

    def mean(self, changes: Mapping[str, Array] = NO_CHANGES) -> float:
        """Mean [arcmin] over the population at the mean change, over a fixed Sobol sample.

        Changes are compared over the same units, so that their difference has no sampling noise.
        """
        key = frozenset((name, float(np.mean(value))) for name, value in changes.items())
        if not key:
            return self._mean
        return self._mean + self._shifted(key) - self._shifted(frozenset())

    def _shifted(self, key: frozenset[tuple[str, float]]) -> float:
        """Mean [arcmin] of the compared units at changes of one value each."""
        if key not in self._shifts:
            changes = {name: np.asarray(value) for name, value in key}
            self._shifts[key] = float(self._measured(self._compared, changes).mean())
        return self._shifts[key]

    @cached_property
    def _mean(self) -> float:
        (cycloid,) = recall_arrays(("mean",), lambda: (self._measured(self.fixed(FIXED, SEEDS["means"])).mean(),))
        return float(cycloid) + self.involute.mean

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


def _changes_of_rows(changes: Mapping[str, Array], rows: Integers) -> dict[str, Array]:
    """The changes at some of the rows, where they are not the same for all of them."""
    return {name: np.asarray(amount)[rows if np.ndim(amount) else ...] for name, amount in changes.items()}


# Effects of a change of a toleranced input on units on the exact contact, for a batch.


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


# A batch of RV reducers: one unit per row, as a test bench measures them.


ANGLE = "output_angle_deg"
PART = 16384
"""Units in one block: 128 kB per array."""


class RvBatch(MeasurableModel):
    """Backlash of a batch of RV reducers, each unit built to the same allocation.

    With `model` "contact": phi_1 and the backlash of the cycloid stage by first contact of all
    pins, the largest (or mean) over `positions` of a turn, or at `output_angle_deg`. With `model`
    "document": phi_1 + max(0, phi_2) + phi_3 of document B. Every error is drawn from its
    distribution. Rows of the same `unit` (and `lot`) are the same unit where the table has a column
    `repeat`, or one of angles; otherwise every row is a unit. Temperature and lot act through
    effects only; changes of the errors of the cycloid stage and of temperatures act before
    interference is cut off.
    """

    columns = (
        Column("unit", "", "name or number of the unit", text=True, role=Role.UNIT),
        Column("temperature_C", "C", "temperature of the unit", False, role=Role.TEMPERATURE),
        Column("lot", "", "production lot", needed=False, text=True, role=Role.LOT),
        Column(ANGLE, "deg", "angle of the output at which a row was measured", False),
    )
    outputs = (Output("backlash_arcmin", "arcmin", "effective backlash of the unit", low=0.0),)
    parameters = PARAMETERS
    variables = VARIABLES
    changeable = (
        *(Changeable(f"{error}_um", "um", f"{error.replace('_', ' ')} error of the unit") for error in LINEAR_ERRORS),
        Changeable("disc_temperature_K", "K", "temperature of the discs above 20 degC"),
        Changeable("housing_temperature_K", "K", "temperature of the housing above 20 degC"),
    )
    population = True
    corrects: ClassVar[tuple[str, ...]] = ("rv_backlash", "rv_reducer")
    omits: ClassVar[tuple[str, ...]] = ("over_constraint", "planet_coupling", "pin_classes")
    made_to_a_drawing = True
    geometry = GEOMETRY
    of_the_bench = OF_THE_BENCH
    free: ClassVar[Mapping[str, float]] = {}

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        values = {p.name: p.default for p in self.parameters} | dict(parameters or {})
        laws = {name.removesuffix("_um"): law for name, law in (inputs or {}).items()}
        self.model = declared.backlash_model(parameters or {}, None, laws)
        raise_all(declared.undercut(self.model.geometry))
        design = {v.name: float(v.document or 0.0) for v in self.variables} | dict(designs or {})
        self.contact = ContactUnits(values, design, inputs or {}) if values[MODEL] == CONTACT else None
        columns = {name: np.array([value], dtype=float) for name, value in design.items()}
        self.allocation = declared.allocation(columns)
        self.total = self.model.total(self.allocation)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        row = _units(table)
        if self.contact is not None:
            return {"backlash_arcmin": self.contact.predict(row, rng, changes, table.get(ANGLE))}
        count = int(row.max(initial=-1)) + 1
        cycloid = drawn(self.total.clipped, count, rng)[row] + opening(self.model, changes)
        effective = np.maximum(cycloid, 0.0) + drawn(self.total.free, count, rng)[row]
        return {"backlash_arcmin": effective / ARCMIN}

    def row_by_row(self, columns: Collection[str]) -> bool:
        return "repeat" not in columns and ANGLE not in columns

    def means(self, changes: Mapping[str, Array] = NO_CHANGES) -> Mapping[str, float]:
        if self.contact is not None:
            return {"backlash_arcmin": self.contact.mean(changes)}
        total = self.total.shifted(float(np.mean(opening(self.model, changes))))
        exact = Convolution().propagate(total, 0.9973, ARCMIN)
        return {"backlash_arcmin": float(exact.mean.value[0]) / ARCMIN}

    def law_sample(self) -> Mapping[str, Array]:
        return {} if self.contact is None else {"backlash_arcmin": self.contact.law_sample}

    def sources(self) -> Sources:
        if self.contact is not None:
            return ContactSources(self.contact).sources()
        return sources_of(self.model, self.allocation, self.total)


def opening(model: BacklashModel, changes: Mapping[str, Array]) -> Array | float:
    """Change of phi_2 [rad] by changes of errors [um] and temperatures [K]: A . change/(e z_c)."""
    errors = {error: UM * np.asarray(changes.get(f"{error}_um", 0.0)) for error in LINEAR_ERRORS}
    rises = [np.asarray(changes.get(f"{part}_temperature_K", 0.0)) for part in ("disc", "housing")]
    return model.opening(errors) + model.thermal_opening(*rises)


def _units(table: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
    """Number (n,) of the unit that each row is about, in the order of the units' own numbers."""
    ranks = ranks_of_units(table)
    if "repeat" not in table and ANGLE not in table:
        return ranks
    lots = table.get("lot", np.zeros(len(ranks)))
    numbers: dict[tuple[Any, Any], int] = {}
    order = np.argsort(ranks)
    for pair in zip(lots[order].tolist(), table["unit"][order].tolist(), strict=True):
        numbers.setdefault(pair, len(numbers))
    pairs = zip(lots.tolist(), table["unit"].tolist(), strict=True)
    return np.array([numbers[pair] for pair in pairs], dtype=np.int64)


def drawn(terms: tuple[Term, ...], count: int, rng: np.random.Generator) -> Array:
    """The sum of `terms` (of one design) in `count` units, (count,), by parts that fit a cache."""
    total = np.empty(count)
    for start in range(0, count, PART):
        part = total[start : start + PART]
        part[:] = sum_at_probabilities(terms, rng.random((len(terms), len(part))))
    return total


def sum_at_probabilities(terms: tuple[Term, ...], drawn: Array) -> Array:
    """The sum (n,) of `terms` (of one design) at probabilities (terms, n), which it overwrites."""
    linear = np.array([np.squeeze(term.linear) for term in terms])
    constant = sum(float(np.squeeze(term.constant)) for term in terms)
    for at, (row, term) in enumerate(zip(drawn, terms, strict=True)):
        if term.quadratic is None and isinstance(term.distribution, Uniform):
            constant -= linear[at]  # z = 2 p - 1 without a pass over p
            linear[at] *= 2.0
        else:
            row[:] = term.distribution.quantile(row)
    total = linear @ drawn
    total += constant
    for row, term in zip(drawn, terms, strict=True):
        if term.quadratic is not None:
            row *= row
            row *= np.squeeze(term.quadratic)
            total += row
    return np.asarray(total)


# Units drawn at random, stage by stage: a Monte Carlo of the whole reducer in parts.
#
# The draws and their sum are those of the model `rv_batch`; here the three stages stay separate, and
# only the statistics of a part are kept, so that memory does not grow with the units.


@dataclass(frozen=True, slots=True, eq=False)
class Units:
    """phi_1, phi_2 (below 0: interference) and phi_3 of units [rad], each (n,)."""

    phi_1: Array
    phi_2: Array
    phi_3: Array

    @property
    def effective(self) -> Array:
        """phi_1 + max(0, phi_2) + phi_3 [rad], (n,)."""
        backlash = np.maximum(self.phi_2, 0.0)
        backlash += self.phi_1
        backlash += self.phi_3
        return backlash


def units(total: ClippedSum, count: int, rng: np.random.Generator) -> Iterator[Units]:
    """`count` units of one design, in parts; `total` is that of `BacklashModel.total`."""
    split = len(total.clipped)
    z = np.empty((split + 2, min(PART, count)))
    for start in range(0, count, PART):
        z = z if count - start >= PART else np.empty((split + 2, count - start))
        rng.random(out=z)
        first, third = (sum_at_probabilities((term,), z[split + i :][:1]) for i, term in enumerate(total.free))
        yield Units(first, sum_at_probabilities(total.clipped, z[:split]), third)


@dataclass(frozen=True, slots=True)
class Batch:
    """Statistics of the units of a batch: sums of powers [rad^k], counts, and a histogram.

    `sums` are of phi_1, phi_2, phi_3 and backlash (effective); `conforming` units keep the limit,
    `interfering` units have phi_2 < 0; `counts` are the units between consecutive edges [rad], the
    outermost with those beyond the edges.
    """

    sums: Mapping[str, PowerSums]
    conforming: int
    interfering: int
    least: float
    most: float
    edges: Array
    counts: NDArray[np.int64]

    @property
    def units(self) -> int:
        """Number of units."""
        return self.sums["backlash"].count


def batch(total: ClippedSum, count: int, limit: float, edges: Array, rng: np.random.Generator) -> Batch:
    """Statistics of `count` >= 1 units against a backlash limit [rad]; the edges evenly spaced."""
    about = {"phi_1": total.free[0], "phi_3": total.free[1]}
    centres = {name: float(term.cumulants()[0][0]) for name, term in about.items()}
    centres["phi_2"] = float(sum(term.cumulants()[0][0] for term in total.clipped))
    centres["backlash"] = centres["phi_1"] + max(centres["phi_2"], 0.0) + centres["phi_3"]
    sums = {name: PowerSums(0, centre) for name, centre in centres.items()}
    counts = np.zeros(len(edges) - 1, dtype=np.int64)
    conforming = interfering = 0
    least, most = np.inf, -np.inf
    for part in units(total, count, rng):
        backlash = part.effective
        columns = {"phi_1": part.phi_1, "phi_2": part.phi_2, "phi_3": part.phi_3}
        for name, values in (columns | {"backlash": backlash}).items():
            sums[name] = sums[name].with_values(values)
        conforming += int(np.count_nonzero(backlash <= limit))
        interfering += int(np.count_nonzero(part.phi_2 < 0.0))
        least, most = min(least, float(backlash.min())), max(most, float(backlash.max()))
        counts += _count_by_bin(backlash, edges)
    return Batch(sums, conforming, interfering, least, most, edges, counts)


def _count_by_bin(values: Array, edges: Array) -> NDArray[np.int64]:
    """Numbers of values between evenly spaced edges, the outermost with those beyond the edges."""
    bins = len(edges) - 1
    at = (values - edges[0]) * (bins / (edges[-1] - edges[0]))
    np.clip(at, 0.0, bins - 1, out=at)
    return np.bincount(at.astype(np.int64), minlength=bins)
