"""Units that are simulated one by one: measured final values beside those at the same inputs."""

from __future__ import annotations

from functools import partial

import numpy as np
import scipy

from ....gap_population_records import PopulationLine
from ....models.effects.readings import unit_numbers
from ....models.inputs.distribution import Array
from ....models.measurable import Role
from ..predictor import predictor
from ..result import Ending
from ..setup import LEAST_NAMED, left_of
from .lines import Compared, batches
from .statistics import Look, Statistic, along, peakedness, skewness, spread, two_of

EXACT = 1e-9
"""Share of the simulated scatter below which readings are the simulation itself."""
NONE = "no difference seen: measured is as simulated"


def compared(end: Ending) -> tuple[PopulationLine, ...]:
    """Lines of every output, before and after where anything was named.

    Before, the model is as it is: not even the zero of an angle is taken out.
    """
    setup = end.setup
    plain = predictor(setup.plan, setup.data)({})
    outputs = setup.data.outputs
    left = np.split(left_of(setup, end.fit), len(outputs))
    found: tuple[PopulationLine, ...] = ()
    for model, stream in (("before", 0), ("after", 1)) if end.fit.members else (("before", 0),):
        for at, output in enumerate(outputs):
            measured = setup.data.measured[output.name]
            simulated = plain[output.name] if model == "before" else measured - left[at]
            found += _lines(end, at, model, stream, simulated)
    return found


def _lines(
    end: Ending, at: int, model: str, stream: int, simulated: Array
) -> tuple[PopulationLine, ...]:
    setup = end.setup
    output, noise = setup.data.outputs[at], end.analysis.bare.noises[at]
    kept = np.arange(len(simulated)) if noise.good is None else np.flatnonzero(noise.good)
    s, measured = simulated[kept], setup.data.measured[output.name][kept]
    r = measured - s
    order = unit_numbers(setup.data.readings)[kept].astype(float)
    scale = max(float(np.std(s)), float(np.std(measured)), 1e-300)
    looks = _looks(output.unit, s, order, max(float(np.std(r)), EXACT * scale))
    if float(np.std(r)) <= EXACT * scale and abs(float(r.mean())) <= EXACT * scale:
        shown = _shown(s, order)
        return tuple(_same(one, model, output.name, shown.get(one.name, 0.0)) for one in looks)
    rng = np.random.default_rng([setup.plan.seed, 15, stream, at])
    settings = setup.plan.settings
    count = batches(len(r))
    drawn = rng.permuted(np.tile(r, (count, 1)), axis=1) * rng.choice([-1.0, 1.0], (count, len(r)))
    # one supplier is drawn as such: readings put in another order keep a second one
    normal = float(np.std(r)) * rng.standard_normal((count, len(r)))
    looks = tuple(_drawn(one, normal) if one.name == "two suppliers" else one for one in looks)
    whole = Compared(looks, r, drawn, settings.false_rate, LEAST_NAMED)
    return whole.lines(model, output.name, _shown(s, order), rng)


def _looks(unit: str, s: Array, order: Array, std: float) -> tuple[Look, ...]:
    """Statistics of differences (b, n) from simulated values s (n,): those of s + x less of s."""
    lone = float(np.std(s)) > 0.0
    more = [
        Look("spread", "standard deviation", unit, _beyond(spread, s)),
        Look("shape", "skewness", "", _beyond(skewness, s)),
        Look("shape", "kurtosis", "", _beyond(peakedness, s)),
    ]
    return (
        Look("location", "mean", unit, _mean),
        *(more if lone else ()),
        Look("mixture", "two suppliers", "",
             two_of(partial(_normal, std), std), signed=False),
        Look("trend", "first to last unit", unit, along(order)),
    )  # fmt: skip


def _beyond(of: Statistic, s: Array) -> Statistic:
    base = float(of(s[None])[0])
    return lambda x: of(s + x) - base


def _normal(std: float, x: Array) -> Array:
    return np.asarray(scipy.stats.norm.logpdf(x, scale=std))


def _shown(s: Array, order: Array) -> dict[str, float]:
    """The statistics of simulated values s (n,) that differences are added to."""
    of = {"mean": _mean, "standard deviation": spread, "skewness": skewness,
          "kurtosis": peakedness, "first to last unit": along(order)}  # fmt: skip
    return {name: float(one(s[None])[0]) for name, one in of.items()}


def _mean(x: Array) -> Array:
    return np.asarray(x.mean(axis=1))


def _drawn(one: Look, normal: Array) -> Look:
    """The same statistic, simulated batches of which are normal ones."""
    return Look(one.aspect, one.name, one.unit, lambda x: one.of(x if len(x) == 1 else normal),
                one.signed)  # fmt: skip


def _same(one: Look, model: str, output: str, value: float) -> PopulationLine:
    return PopulationLine(
        model=model,
        output=output,
        aspect=one.aspect,
        statistic=one.name,
        unit=one.unit,
        simulated=value,
        measured=value,
        difference=0.0,
        low=0.0,
        high=0.0,
        chance=0.0,
        would_show=0.0,
        verdict=NONE,
    )


def has_units(end: Ending) -> bool:
    """Whether rows are units that are simulated one by one."""
    data = end.setup.data
    named = any(c.role is Role.UNIT for c in data.target.columns)
    return named and not data.target.population and end.setup.plan.model is not None
