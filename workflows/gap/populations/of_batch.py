"""A batch compared with the model's population, before and after what was named."""

from __future__ import annotations

import numpy as np

from ....gap_population_records import PopulationLine
from ....models.effects.readings import labels_of, unit_numbers
from ....models.inputs.distribution import Array
from ....models.measurable import Role
from ..result import Ending
from ..setup import LEAST_NAMED, Setup, left_of
from .lines import Compared, batches
from .statistics import along, between_lots, looks_of, two_of, unlike

AFTER = "after"


def compared(end: Ending) -> tuple[PopulationLine, ...]:
    """Lines before, and after where anything was named."""
    bare = end.analysis.bare
    found = _lines(end, bare.setup, left_of(bare.setup, bare.empty), 0, "before")
    if end.fit.members or end.analysis.scatter:
        found += _lines(end, end.setup, left_of(end.setup, end.fit), 1, AFTER)
    return found


def _lines(
    end: Ending, setup: Setup, left: Array, stream: int, model: str
) -> tuple[PopulationLine, ...]:
    """Of units as far as they are from what the model predicts, (n,)."""
    output, kept = setup.data.outputs[0], end.analysis.bare.noises[0].kept
    law, middle = end.analysis.bare.setup.laws[output.name], 0.0
    for one in end.analysis.scatter[:1] if model == AFTER else ():
        law, middle = one.changed(law), one.moves
    x = left[kept] + middle
    readings = setup.data.readings
    order = unit_numbers(readings)[kept].astype(float)
    lots = between_lots(labels_of(readings[Role.LOT])[1][kept]) if Role.LOT in readings else None
    looks = looks_of(
        output.unit, order, two_of(law, law.std),
        unlike(law.histogram.ppf((np.arange(len(x)) + 0.5) / len(x))), lots,
    )  # fmt: skip
    settings, rng = setup.plan.settings, np.random.default_rng([setup.plan.seed, 14, stream])
    count = batches(len(x))
    drawn = law.histogram.rvs(size=(count, len(x)), random_state=rng)
    shown = setup.data.measured[output.name][kept] - x
    offset = {"mean": float(shown.mean()), "median": float(shown.mean()),
              "first to last unit": float(along(order)(shown[None])[0])}  # fmt: skip
    whole = Compared(looks, x, drawn, settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, offset, rng)
