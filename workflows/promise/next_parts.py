"""What to measure next: where twenty more parts lower the cost of an assured promise most.

First the shadow price: with more parts the norm of the same tolerances falls, and the multiplier of
the promise says what that is worth (envelope theorem). It leaves out that the next sample will say
something else than the last one; for the first few the expected least cost over what it may say
(pre-posterior analysis, Raiffa & Schlaifer 1961) is computed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.exact.solver import closed_form
from ...models.capability import Knowledge
from ...problems.spread import spread_of
from ...problems.stack import Stack
from ...problems.stack.anew import with_knowledge
from .least import Solved, solved

Array = NDArray[np.float64]
MORE = 20
"""Parts that are measured next."""
FIRST = 3
"""Characteristics whose gain is computed by re-optimisation."""
PLACES = 16
"""Outcomes of the next sample, of equal probability."""
COLUMNS = ("rank", "part", "parts_measured", "more_parts", "shadow_gain", "shadow_gain_percent",
           "expected_gain", "expected_gain_percent")  # fmt: skip


def next_parts(stack: Stack, first: int = FIRST) -> pd.DataFrame:
    """The ranking of the measured parts of a stack with an assured promise and no objective but the
    cost; empty where its least cost is not known in closed form.
    """
    names = [part.name for part in stack.definition.parts if part.sample is not None]
    start = solved(stack)
    if start is None or not names:
        return pd.DataFrame(columns=list(COLUMNS))
    cost = float(start[1].cost[0])
    gains = {name: shadow_gain(stack, name, start) for name in names}
    ranked = sorted(names, key=lambda name: -gains[name])
    rows = []
    for rank, name in enumerate(ranked, 1):
        expected = expected_gain(stack, name, start) if rank <= first else np.nan
        rows.append((rank, name, int(_known(stack, name).n), MORE, gains[name],
                     100.0 * gains[name] / cost, expected, 100.0 * expected / cost))  # fmt: skip
    return pd.DataFrame(rows, columns=list(COLUMNS))


def shadow_gain(stack: Stack, name: str, start: Solved | None = None) -> float:
    """What more parts of one characteristic are worth at the present tolerances.

    `start` is the form of the stack with its least cost, where it is known.
    """
    start = start or solved(stack)
    anew = closed_form(with_knowledge(stack, {name: with_more(_known(stack, name), 1.0)}))
    if start is None or anew is None:
        return 0.0
    form, found = start
    before, after = (
        spread_of(one, found.t[:, None, :] * np.stack(
            [np.array([way.spread for way in feature.ways])[found.chosen[0, at]]
             for at, feature in enumerate(one.features)], axis=1)[None]).value[0]
        for one in (form, anew)
    )  # fmt: skip
    return float(found.multiplier[0] @ np.maximum(before - after, 0.0))


def expected_gain(stack: Stack, name: str, start: Solved | None = None) -> float:
    """The expected fall of the least cost by the next sample of one characteristic.

    What it will say of the variance follows an F distribution; its mean is taken as it is. `start`
    is as in `shadow_gain`.
    """
    from scipy import stats  # takes long to import

    start = start or solved(stack)
    if start is None:
        return float("nan")
    known = _known(stack, name)
    share = (np.arange(PLACES) + 0.5) / PLACES
    ratios = stats.f.ppf(share, MORE, known.df)
    costs = []
    for ratio in ratios.tolist():
        anew = solved(with_knowledge(stack, {name: with_more(known, ratio)}))
        if anew is None:
            return float("nan")
        costs.append(float(anew[1].cost[0]))
    return float(start[1].cost[0]) - float(np.mean(costs))


def with_more(known: Knowledge, ratio: float) -> Knowledge:
    """Knowledge with `MORE` parts whose variance is `ratio` times that known before."""
    df = known.df + MORE
    share = (known.df + MORE * ratio) / df
    gauge = known.difference
    if gauge is not None:
        gauge = replace(gauge, seen=gauge.gauge + share * gauge.own, seen_df=gauge.seen_df + MORE)
    return replace(known, std=known.std * float(np.sqrt(share)), n=known.n + MORE, df=df,
                   difference=gauge)  # fmt: skip


def _known(stack: Stack, name: str) -> Knowledge:
    sample = next(part.sample for part in stack.definition.parts if part.name == name)
    assert sample is not None
    return sample.knowledge
