"""What the promise of a run is worth by parts that were made to its drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ...problems.promise import ASSURANCE, YIELD
from ...problems.stack import Stack
from ...problems.stack.definition import Part
from .least import Least, cheapest

Array = NDArray[np.float64]
CHANGED = 0.01
"""Probability below which a difference of scatter or mean is no chance."""
SAME = 0.02
"""Share of a tolerance below which it stays as it is."""


@dataclass(frozen=True, slots=True)
class Review:
    """Sentences, and a row for each measured part."""

    lines: tuple[str, ...]
    parts: pd.DataFrame


def review(
    before: Stack,
    design: Mapping[str, float],
    now: Stack,
    reset: Stack | None,
    made: Sequence[str],
    since: Stack | None = None,
    attributed: str = "",
) -> Review:
    """The review of a run's design by parts made to it; the stacks as `Reopened` has them."""
    full = _full(before, design)
    promise = before.promises
    assert promise is not None
    told = [f"promised: {promise.promise.words()}"]
    told.append(f"when it was promised: {_worth(before, full)}")
    told.append(f"by the parts now: {_worth(now, full)}")
    anew = Least.none(before) if reset is None else cheapest(_alone(reset))
    cost = float(before.outputs_of(full[None, :])["cost"][0])
    if reset is not None and np.isfinite(anew.cost):
        side = "saves" if anew.cost < cost else "costs"
        told.append(
            f"the least cost that keeps the promise now is {anew.cost:.4g}; the drawing's "
            f"is {cost:.4g}: a new allocation {side} {abs(cost - anew.cost):.4g} "
            f"({100.0 * abs(1.0 - anew.cost / cost):.2g} %), {_worth(reset, anew.design)}"
        )
    else:
        told.append("no allocation keeps the promise by what the parts say now, even at the "
                    "tightest tolerances")  # fmt: skip
    rows = [_row(part, before, now, design, anew.design, part.name in made)
            for part in before.definition.parts]  # fmt: skip
    told += [text for one in now.definition.parts if one.sample is not None
             and one.name in made for text in
             (f"{one.name} {finding.text}" for finding in one.sample.found)]  # fmt: skip
    if since is not None:
        told += _since(since, now, made, full)
    if attributed:
        told.append(f"the units' own measurement: {attributed}")
    return Review(tuple(told), pd.DataFrame(rows))


def _full(stack: Stack, design: Mapping[str, float]) -> Array:
    """A full design (all variables,) with the half-widths of the drawing."""
    found = stack.corner(tight=True)
    for at, name in enumerate(stack.names):
        found[at] = float(design.get(name, found[at]))
    return found


def _alone(stack: Stack) -> Stack:
    """The same with the cost as the only objective."""
    return Stack(replace(stack.given, objectives=("cost",)))


def _worth(stack: Stack, design: Array) -> str:
    """Yield by the estimates and assurance of a full design, the least of all requirements."""
    found = stack.outputs_of(design[None, :])
    each = {name: min(float(value[0]) for key, value in found.items()
                      if key.split(".")[-1] == name and np.isfinite(value[0]))
            for name in (YIELD, ASSURANCE)}  # fmt: skip
    return (f"{each[YIELD]:.4g} % conform by the estimates, the promise is kept with a probability "
            f"of {each[ASSURANCE]:.1f} %")  # fmt: skip


def _row(
    part: Part, before: Stack, now: Stack, design: Mapping[str, float], anew: Array, made: bool
) -> dict[str, object]:
    """What changed of a part, and what its tolerance should be."""
    name = f"{part.name}_t"
    t = float(design.get(name, part.low))
    new = float(anew[before.names.index(name)])
    ends = [_capability(_part(one, part.name)) for one in (before, now)]
    sample = _part(now, part.name).sample
    advice = "keep"
    if not np.isfinite(new):
        advice = "unknown"
    elif abs(new / t - 1.0) > SAME:
        advice = "loosen" if new > t else "tighten"
    return {
        "part": part.name,
        "unit": part.unit,
        "parts": len(sample.deviations) if made and sample is not None else 0,
        "cp_then": ends[0],
        "cp_now": ends[1],
        "offset": sample.knowledge.mean if made and sample is not None else np.nan,
        "tolerance": t,
        "new_tolerance": new,
        "advice": "keep" if part.fixed else advice,
    }


def _part(stack: Stack, name: str) -> Part:
    return next(one for one in stack.definition.parts if one.name == name)


def _capability(part: Part) -> float:
    """Half-width over three standard deviations, of whatever law."""
    m1, m2 = part.distribution.raw_moments(2)[1:]
    return float(1.0 / (3.0 * np.sqrt(m2 - m1**2)))


def _since(since: Stack, now: Stack, made: Sequence[str], full: Array) -> list[str]:
    """What the parts say that earlier ones did not."""
    told = [f"by the earlier parts: {_worth(since, full)}"]
    for name in made:
        old, new = _part(since, name).sample, _part(now, name).sample
        if old is None or new is None or old is new:
            continue
        a, b = old.deviations, new.deviations
        ratio = float(np.var(b, ddof=1) / np.var(a, ddof=1))
        tail = float(stats.f.cdf(ratio, len(b) - 1, len(a) - 1))
        if 2.0 * min(tail, 1.0 - tail) < CHANGED:
            told.append(f"{name} scatters {np.sqrt(ratio):.2g} times as much as the earlier parts "
                        f"(by chance: {2.0 * min(tail, 1.0 - tail):.2g})")  # fmt: skip
        moved = stats.ttest_ind(b, a, equal_var=False)
        if float(moved.pvalue) < CHANGED:
            told.append(
                f"the mean of {name} moved by {float(b.mean() - a.mean()):+.4g} "
                f"{_part(now, name).unit} (by chance: {float(moved.pvalue):.2g})"
            )
    return told
