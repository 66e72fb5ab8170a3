"""Backlash by stage: mean and spread of involute, cycloid and output stage (document B)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import READING, Value, number
from ....models.propagation.sums import total_cumulants
from ....models.rv_reducer import declared
from ....models.rv_reducer.reading import PRINTED
from ....units import ARCMIN
from ..calculation import Calculation, Computed
from .results import output, parameter, quantities, tabulated

STAGES = ("involute", "cycloid", "output")


class BacklashStages(Calculation):
    """Mean and spread of the backlash of each stage over units, in closed form.

    As document B prints it (reading = "printed"). The cycloid stage as geometry has it: below zero
    is interference.
    """

    name = "backlash_stages"
    about = "Mean and spread of the backlash of each stage over units, in closed form."
    reference = "document B, backlash calculation"
    sampled = False
    parameters = (
        parameter(
            "crank_bearing_um",
            2.0,
            "clearance c of the crank-arm bearings, zone [0, c]",
            "document B: 2 in its table, 20 in its Monte Carlo",
            0.0,
            1e3,
        ),
        parameter("stagger_arcmin", 0.0, "turn of each disc, one ahead and one back", "document B", 0.0, 60.0),
    )
    outputs = tuple(
        declaration
        for stage in STAGES
        for declaration in (
            output(f"{stage}_mean_arcmin", f"mean of the {stage} stage"),
            output(f"{stage}_std_arcmin", f"standard deviation of the {stage} stage"),
            output(f"{stage}_variance_percent", f"share of the {stage} stage in the variance of the sum"),
        )
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        at = {variable.name: float(variable.document or 0.0) for variable in declared.VARIABLES}
        at |= {name: number(value) for name, value in parameters.items()}
        design = {name: np.array([value]) for name, value in at.items()}
        total = declared.backlash_model({READING: PRINTED}, None, {}).total(declared.allocation(design))
        involute, output = total.free
        parts = [total_cumulants(terms) for terms in ((involute,), total.clipped, (output,))]
        mean, variance = np.array([[float(part[k][0]) for part in parts] for k in (0, 1)])
        columns = {
            "mean_arcmin": mean / ARCMIN,
            "std_arcmin": np.sqrt(variance) / ARCMIN,
            "variance_percent": 100.0 * variance / variance.sum(),
        }
        numbers = {
            f"{stage}_{name}": float(column[row])
            for name, column in columns.items()
            for row, stage in enumerate(STAGES)
        }
        meaning = (
            f"Backlash by stage; crank-arm bearings 0..{parameters['crank_bearing_um']} um, "
            f"stagger {parameters['stagger_arcmin']} arcmin"
        )
        return Computed(quantities(numbers), (tabulated("stages", meaning, {"stage": STAGES, **columns}),))
