"""Calculations of document A: assembly and adjustment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from ....models.assembly.process import (
    INSERTIONS,
    READINGS,
    AdjustmentWeights,
    DatumFlowChain,
    gains,
    plane_process,
    terminal_weight,
)
from ....models.assembly.transmission import ECCENTRICS, AngleMapping, Row, Transmission, rows
from ....problems.rv_transmission_error import RvTransmissionError
from ....problems.rv_transmission_error.declared import AXES, DOCUMENT_MRAD, PARTS
from ....problems.rv_transmission_error.form import COMPOSITES, implied_costs, optimal_allocation, sensitivities
from ....records import Axis
from ....section import Array, Output, Parameter, Value, number
from ....units import ARCSEC
from ..recipes import Calculation, Computed, Quantity
from ..records import ComputedTable
from .reducer import assumed, output, parameter, quantities

LABELS = ("q0", "q5", "q10", "ideal")
"""The rows: precision weight 0, 5, 10, infinite."""
UNITS = {"mrad": "mrad", "percent": "percent", "mrad2": "mrad**2", "arcsec": "arcsec", "N": "N"}
SCALARS = tuple(field.name for field in fields(Row) if field.name not in ("precision_weight", "state_mrad"))
STATES = tuple(f"state_{at}_mrad" for at in range(1, 5))
_FIT = "assumed: no document prints how the angles act on the contact"


def _unit(name: str) -> str:
    return UNITS[name.rpartition("_")[2]]


def _choice(name: str, choices: tuple[str, ...], meaning: str) -> Parameter:
    return parameter(name, choices[0], meaning, "document A", choices=choices)


class AssemblyAdjustment(Calculation):
    """Final errors, transmission error and force of document A's parts at Q = 0, 5, 10, infinity.

    The four printed part errors, assembled with the printed recursion, then the loaded contact.
    """

    name = "assembly_adjustment"
    about = "Final errors, transmission error and force of document A's parts by precision weight."
    reference = "document A, table of precision weights"
    sampled = False
    parameters = (
        _choice("reading", READINGS, "what the weight Q weighs"),
        _choice("insertion", INSERTIONS, "whether a step adjusts before or after its part is put in"),
        assumed(
            "eccentrics",
            ECCENTRICS[0],
            "crankshafts 1 and 2 act on eccentrics of one crank, or of a crank of their own",
            _FIT,
            choices=ECCENTRICS,
        ),
        assumed("absorption", 1.0, "share of an angle that reaches the contact", _FIT, 0.0, 10.0),
        assumed(
            "floor_arcsec", 0.0, "amplitude of the transmission error that is not due to these angles", _FIT, 0.0, 1e3
        ),
    )
    outputs = tuple(
        Output(f"{label}_{name}", _unit(name), f"{name.replace('_', ' ')} at {label}")
        for label in LABELS
        for name in (*SCALARS, *STATES)
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        floor = number(parameters["floor_arcsec"]) * ARCSEC
        mapping = AngleMapping(str(parameters["eccentrics"]), number(parameters["absorption"]), floor)
        computed_rows = rows(Transmission(mapping=mapping), str(parameters["reading"]), str(parameters["insertion"]))
        quantities = {
            f"{label}_{name}": Quantity(value, _unit(name))
            for label, row in zip(LABELS, computed_rows, strict=True)
            for name, value in _values(row).items()
        }
        return Computed(quantities, (_table(computed_rows, parameters),))


def _values(row: Row) -> dict[str, float]:
    states = dict(zip(STATES, row.state_mrad, strict=True))
    return {name: float(getattr(row, name)) for name in SCALARS} | states


def _table(computed_rows: tuple[Row, ...], parameters: Mapping[str, Value]) -> ComputedTable:
    names = (*STATES, *SCALARS)
    columns = [np.array([_values(row)[name] for row in computed_rows]) for name in names]
    stated = ", ".join(f"{key} {value}" for key, value in parameters.items())
    return ComputedTable(
        "rows",
        f"Document A's table recomputed: {stated}",
        (Axis("precision_weight", "1"), *(Axis(name, _unit(name)) for name in names)),
        (np.array(["0", "5", "10", "infinite"]), *columns),
    )


# What follows from document A's datum flow chains: matrices, weights, gains, variables.


STEPS = range(1, 5)
PAIRS = tuple((a, b) for a in STEPS for b in STEPS)


class AssemblyStructure(Calculation):
    """Matrices, adjustment weights and gains that follow from document A's datum flow chains."""

    name = "assembly_structure"
    about = "Matrices, adjustment weights and gains that follow from the datum flow chains."
    reference = "document A, case study and general example"
    sampled = False
    parameters = (
        parameter("precision_weight", 10.0, "weight Q of the gains", "document A", 0.0, 1e9),
        parameter(
            "absent_weight",
            1000.0,
            "weight of adjusting a part that is not there",
            "document A",
            0.0,
            1e12,
            open_low=True,
        ),
    )
    outputs = (
        *(Output(f"flow_{a}_{b}", "1", f"F = B, row {a}, column {b}") for a, b in PAIRS),
        *(Output(f"weight_{a}_{b}", "1", f"R at step {a} of part {b}") for a, b in PAIRS),
        *(Output(f"adjustable_{a}_{b}", "1", f"T at step {a} of part {b}") for a, b in PAIRS),
        *(
            Output(f"small_{a}_{b}", "1", f"matrix of one chain of two parts, row {a}, column {b}")
            for a in (1, 2)
            for b in (1, 2)
        ),
        *(Output(f"observed_{a}_{b}", "1", f"C, row {a}, column {b}") for a in (1, 2) for b in STEPS),
        output("absent_share_percent", "largest gain of a part that is not there yet, of the largest gain of its step"),
        Output("tolerances", "1", "number of tolerances of the four parts"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        chain = DatumFlowChain()
        weights = chain.weights(AdjustmentWeights(absent=number(parameters["absent_weight"])))
        gain = _gains(weights, number(parameters["precision_weight"]))
        matrices = {
            "flow": chain.error_matrix(),
            "weight": weights,
            "adjustable": chain.adjustable().astype(float),
            "small": DatumFlowChain((0, 1), ("first", "second")).error_matrix(),
            "observed": chain.observation(),
        }
        numbers = {
            f"{name}_{a + 1}_{b + 1}": Quantity(float(value), "1")
            for name, matrix in matrices.items()
            for (a, b), value in np.ndenumerate(matrix)
        }
        tolerances = [variable for variable in RvTransmissionError.declaration.variables if variable.tolerance]
        numbers["absent_share_percent"] = Quantity(_absent(gain, chain.adjustable()), "percent")
        numbers["tolerances"] = Quantity(float(len(tolerances)), "1")
        return Computed(numbers, (_structure_table(gain),))


def _gains(weights: Array, precision: float) -> Array:
    """K, shape (N, N, N)."""
    process = plane_process(weights=weights, absent=float(weights.max()))
    terminal = terminal_weight(process, np.array([precision]), "printed")
    return np.asarray(gains(process, terminal)[0])


def _absent(gain: Array, adjustable: NDArray[np.bool_]) -> float:
    sizes = np.abs(gain).max(axis=2)  # of each part at each step
    return float(100.0 * np.max(np.where(adjustable, 0.0, sizes) / sizes.max(axis=1)[:, None]))


def _structure_table(gain: Array) -> ComputedTable:
    step, part = np.meshgrid(STEPS, STEPS, indexing="ij")
    columns = gain.reshape(-1, 4)
    return ComputedTable(
        "gains",
        "Gain K(k): adjustment of each part per unit of each angle",
        (Axis("step", "1"), Axis("part", "1"), *(Axis(f"of_angle_{at}", "1") for at in STEPS)),
        (step.ravel(), part.ravel(), *columns.T),
    )


# Crankshaft against gear tolerances of least cost, in document A's problem.


class ToleranceRatio(Calculation):
    """Crankshaft over gear tolerance of least cost at equal costs, and the costs that print it.

    Costs a/v^b of every angle, root sum of squares of the composite error.
    """

    name = "tolerance_ratio"
    about = "Crankshaft over gear tolerance of least cost at equal costs, and the costs implied."
    reference = "document A, optimal tolerance allocation"
    sampled = False
    parameters = (
        assumed(
            "composite",
            COMPOSITES[0],
            "composite error: sum of the four final angles, or their root sum of squares",
            "assumed: not printed",
            choices=COMPOSITES,
        ),
        assumed("exponent", 1.0, "b of the cost a/v^b", "assumed: not printed", 0.0, 10.0, open_low=True),
    )
    outputs = (
        Output("equal_costs", "1", "crankshaft over gear tolerance at equal costs"),
        Output("implied_gear_2", "1", "cost of gear 2 over the mean, that the printed table needs"),
        Output("implied_gear_1", "1", "the same of gear 1"),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        influence, b = sensitivities(str(parameters["composite"])), number(parameters["exponent"])
        free = optimal_allocation(np.ones(len(influence)), influence, 1.0, b)
        printed = np.array(list(DOCUMENT_MRAD.values()))
        costs = implied_costs(printed, influence, b)
        numbers = {
            "equal_costs": float(free[0] / free[len(AXES)]),
            "implied_gear_1": float(costs[3:6].mean()),
            "implied_gear_2": float(costs[9:12].mean()),
        }
        table = ComputedTable(
            "implied_costs",
            "Relative costs, mean 1, under which the printed allocation is the optimum",
            (Axis("tolerance", ""), Axis("printed_mrad", "mrad"), Axis("implied_cost", "1"), Axis("influence", "1")),
            (np.array([f"{part} {axis}" for part in PARTS for axis in AXES]), printed, costs, influence),
        )
        return Computed(quantities(numbers), (table,))
