"""What to measure next: where twenty more parts lower the cost of an assured promise most.

First the shadow price: with more parts the norm of the same tolerances falls, and the multiplier of
the promise gives the gain (envelope theorem). This ignores that the next sample will differ from
the last one; for the first few the expected least cost over its outcomes (pre-posterior analysis,
Raiffa & Schlaifer 1961) is computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.special import ndtri

from ...algorithms.exact.choices import Optimum
from ...algorithms.exact.solver import closed_form
from ...arrays import Array
from ...models.capability import Knowledge
from ...problems.forms import Form
from ...problems.promise import PROMISED
from ...problems.spread import spread_of
from ...problems.tolerance_problem import ToleranceProblem
from ..choice.prices import prices
from ..choice.slopes import slopes_of
from .anew import known_of, with_knowledge
from .least import Least, Solved, cheapest, solved

MORE = 20
"""Parts that are measured next."""
FIRST = 3
"""Characteristics whose gain is computed by re-optimisation."""
PLACES = 16
"""Outcomes of the next sample, of equal probability."""


def next_parts(problem: ToleranceProblem, first: int = FIRST, least: Least | None = None) -> pd.DataFrame:
    """The ranking of the measured parts of a problem with an assured promise and no objective but
    the cost. `least` is its least cost where that is known.

    Where the least cost has no closed form the shadow price is that of the conditions of an optimum
    at the cheapest design, and nothing is optimised again. Empty where neither is known.
    """
    known = known_of(problem)
    start = solved(problem) if known else None
    if start is not None:
        cost = float(start[1].cost[0])
        gains = {name: shadow_gain(problem, name, start) for name in known}
    else:
        least = least or (cheapest(problem) if known and not problem.declaration.sampled else None)
        if least is None or not np.isfinite(least.cost):
            return pd.DataFrame()
        cost, gains = least.cost, shadow_gains(problem, least.design)
    ranked = sorted(gains, key=lambda name: -gains[name])
    rows = []
    for rank, name in enumerate(ranked, 1):
        reoptimised = rank <= first and start is not None
        expected = expected_gain(problem, name, start) if reoptimised else np.nan
        rows.append(
            {
                "rank": rank,
                "part": name,
                "parts_measured": int(known[name].n),
                "more_parts": MORE,
                "shadow_gain": gains[name],
                "shadow_gain_percent": 100.0 * gains[name] / cost,
                "expected_gain": expected,
                "expected_gain_percent": 100.0 * expected / cost,
            }
        )
    return pd.DataFrame(rows)


def shadow_gain(problem: ToleranceProblem, name: str, start: Solved | None = None) -> float:
    """The gain of more parts of one characteristic at the present tolerances.

    `start` is the form of the problem with its least cost, where it is known.
    """
    start = start or solved(problem)
    better_known = closed_form(with_knowledge(problem, {name: with_more(known_of(problem)[name], 1.0)}))
    if start is None or better_known is None:
        return 0.0
    form, optimum = start
    before, after = (_spread(stated, optimum) for stated in (form, better_known))
    return float(optimum.multiplier[0] @ np.maximum(before - after, 0.0))


def _spread(form: Form, optimum: Optimum) -> Array:
    """Spread (r,) of the requirements of a form at the tolerances and processes of an optimum."""
    spreads = [
        np.array([process.spread for process in feature.ways])[optimum.chosen[0, at]]
        for at, feature in enumerate(form.features)
    ]
    return np.asarray(spread_of(form, optimum.t[:, None, :] * np.stack(spreads, axis=1)[None]).value[0])


def shadow_gains(problem: ToleranceProblem, design: Array) -> dict[str, float]:
    """The same for every characteristic by the conditions of an optimum at a full design (all,).

    The price of the promise is taken as constant per standard normal quantile. Empty where its
    price is not known.
    """
    priced = prices(problem, problem.frame(design[None, :]), slopes_of(problem, design[None, :]))
    promised = priced[priced["output"] == PROMISED] if len(priced) else priced
    if promised.empty or not float(promised["price"].iloc[0]) > 0.0:
        return {}
    known = known_of(problem)
    before = _quantile(problem, design)
    rise = 100.0 * np.exp(-0.5 * before**2) / np.sqrt(2.0 * np.pi)
    gains = {}
    for name, knowledge in known.items():
        better_known = with_knowledge(problem, {name: with_more(knowledge, 1.0)})
        more = max(_quantile(better_known, design) - before, 0.0)
        gains[name] = float(promised["price"].iloc[0]) * rise * more
    return gains


def _quantile(problem: ToleranceProblem, design: Array) -> float:
    """Standard normal quantile of the promised yield in a search."""
    outputs = problem.outputs_of(design[None, :], searching=True)[PROMISED]
    return float(ndtri(np.clip(0.01 * outputs[0], 1e-12, 1.0 - 1e-12)))


def expected_gain(problem: ToleranceProblem, name: str, start: Solved | None = None) -> float:
    """The expected fall of the least cost by the next sample of one characteristic.

    The ratio of its variance to that known follows an F distribution; the mean is taken as it is.
    `start` is as in `shadow_gain`; NaN without a closed form.
    """
    from scipy import stats  # takes long to import

    start = start or solved(problem)
    if start is None:
        return float("nan")
    known = known_of(problem)[name]
    probabilities = (np.arange(PLACES) + 0.5) / PLACES
    ratios = stats.f.ppf(probabilities, MORE, known.df)
    costs = []
    for ratio in ratios.tolist():
        better_known = solved(with_knowledge(problem, {name: with_more(known, ratio)}))
        if better_known is None:
            return float("nan")
        costs.append(float(better_known[1].cost[0]))
    return float(start[1].cost[0]) - float(np.mean(costs))


def with_more(known: Knowledge, ratio: float) -> Knowledge:
    """Knowledge with `MORE` parts whose variance is `ratio` times that known before."""
    df = known.df + MORE
    variance_ratio = (known.df + MORE * ratio) / df
    gauge = known.difference
    if gauge is not None:
        gauge = replace(
            gauge, measured=gauge.gauge + variance_ratio * gauge.part_variance, measured_df=gauge.measured_df + MORE
        )
    return replace(known, std=known.std * float(np.sqrt(variance_ratio)), n=known.n + MORE, df=df, difference=gauge)
