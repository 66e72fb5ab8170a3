"""A batch of RV reducers: one unit per row, as a test bench measures them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Output, Value
from ...errors import raise_all
from ...units import ARCMIN, UM
from ..inputs import Uniform
from ..inputs.distribution import Distribution
from ..measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Role, ranks_of_units
from ..propagation import Convolution, Term
from ..sources import Sources
from . import batch_declared, declared
from .backlash import BacklashModel
from .contact_batch import ContactUnits
from .contact_sources import ContactSources
from .cycloid import LINEAR_ERRORS
from .sources import sources_of

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
    parameters = batch_declared.PARAMETERS
    variables = batch_declared.VARIABLES
    changeable = (
        *(Changeable(f"{error}_um", "um", f"{error.replace('_', ' ')} error of the unit") for error in LINEAR_ERRORS),
        Changeable("disc_temperature_K", "K", "temperature of the discs above 20 degC"),
        Changeable("housing_temperature_K", "K", "temperature of the housing above 20 degC"),
    )
    population = True
    corrects: ClassVar[tuple[str, ...]] = ("rv_backlash", "rv_reducer")
    made_to_a_drawing = True
    geometry = batch_declared.GEOMETRY
    of_the_bench = batch_declared.OF_THE_BENCH
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
        self.contact = (
            ContactUnits(values, design, inputs or {})
            if values[batch_declared.MODEL] == batch_declared.CONTACT
            else None
        )
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
        part[:] = summed(terms, rng.random((len(terms), len(part))))
    return total


def summed(terms: tuple[Term, ...], drawn: Array) -> Array:
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
