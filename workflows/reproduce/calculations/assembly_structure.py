"""What follows from document A's datum flow chains: matrices, weights, gains, variables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from ....declarations import Output, Value, number
from ....models.assembly.chain import AdjustmentWeights, DatumFlowChain
from ....models.assembly.process import plane_process
from ....models.assembly.regulator import gains, terminal_weight
from ....problems.rv_transmission_error import RvTransmissionError
from ....records import Axis
from ..calculation import Calculation, Computed, ComputedTable, Quantity
from .results import output, parameter

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
        return Computed(numbers, (_table(gain),))


def _gains(weights: Array, precision: float) -> Array:
    """K, shape (N, N, N)."""
    process = plane_process(weights=weights, absent=float(weights.max()))
    terminal = terminal_weight(process, np.array([precision]), "printed")
    return np.asarray(gains(process, terminal)[0])


def _absent(gain: Array, adjustable: NDArray[np.bool_]) -> float:
    sizes = np.abs(gain).max(axis=2)  # of each part at each step
    return float(100.0 * np.max(np.where(adjustable, 0.0, sizes) / sizes.max(axis=1)[:, None]))


def _table(gain: Array) -> ComputedTable:
    step, part = np.meshgrid(STEPS, STEPS, indexing="ij")
    columns = gain.reshape(-1, 4)
    return ComputedTable(
        "gains",
        "Gain K(k): adjustment of each part per unit of each angle",
        (Axis("step", "1"), Axis("part", "1"), *(Axis(f"of_angle_{at}", "1") for at in STEPS)),
        (step.ravel(), part.ravel(), *columns.T),
    )
