"""Backlash by stage: mean and spread of involute, cycloid and output stage (document B)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import READING, Output, Parameter, Value, number
from ....models.propagation.sums import total_cumulants
from ....models.rv_reducer import declared
from ....models.rv_reducer.reading import PRINTED
from ....records import Axis
from ....units import ARCMIN
from ..calculation import Calculation, Computed, ComputedTable, Quantity

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
        Parameter(
            "crank_bearing_um",
            2.0,
            "um",
            "clearance c of the crank-arm bearings, zone [0, c]",
            "document B: 2 in its table, 20 in its Monte Carlo",
            low=0.0,
            high=1e3,
        ),
        Parameter(
            "stagger_arcmin",
            0.0,
            "arcmin",
            "turn of each disc, one ahead and one back",
            "document B",
            low=0.0,
            high=60.0,
        ),
    )
    outputs = tuple(
        declaration
        for stage in STAGES
        for declaration in (
            Output(f"{stage}_mean_arcmin", "arcmin", f"mean of the {stage} stage"),
            Output(f"{stage}_std_arcmin", "arcmin", f"standard deviation of the {stage} stage"),
            Output(f"{stage}_variance_percent", "percent", f"share of the {stage} stage in the variance of the sum"),
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
            "mean_arcmin": ("arcmin", mean / ARCMIN),
            "std_arcmin": ("arcmin", np.sqrt(variance) / ARCMIN),
            "variance_percent": ("percent", 100.0 * variance / variance.sum()),
        }
        quantities = {
            f"{stage}_{name}": Quantity(float(column[row]), unit)
            for name, (unit, column) in columns.items()
            for row, stage in enumerate(STAGES)
        }
        table = ComputedTable(
            "stages",
            f"Backlash by stage; crank-arm bearings 0..{parameters['crank_bearing_um']} um, "
            f"stagger {parameters['stagger_arcmin']} arcmin",
            (Axis("stage", ""), *(Axis(name, unit) for name, (unit, _) in columns.items())),
            (np.array(STAGES), *(column for _, column in columns.values())),
        )
        return Computed(quantities, (table,))
