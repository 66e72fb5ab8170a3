"""Crankshaft against gear tolerances of least cost, in document A's problem."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import Output, Value, number
from ....problems.rv_transmission_error.declared import AXES, DOCUMENT_MRAD, PARTS
from ....problems.rv_transmission_error.implied import COMPOSITES, implied_costs, optimal_allocation, sensitivities
from ....records import Axis
from ..calculation import Calculation, Computed, ComputedTable
from .results import assumed, quantities


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
