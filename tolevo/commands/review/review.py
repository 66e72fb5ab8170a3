"""How far the promise of a run holds for parts that were made to its drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from ...models.capability import PartSample
from ...models.inputs import std_of
from ...problems.settings import ASSURANCE
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array
from ..run.changes import value_against_limit
from ..run.promise import Least, cheapest_at, cheapest_design, promised_limits

CHANGED = 0.01
"""Probability below which a difference of scatter or mean is not attributed to chance."""
ZONE_TOLERANCE = 0.02
"""Relative change of a tolerance below which it stays as it is."""
AS_MADE = "as made"
"""Advice on a standard deviation that is estimated from parts and set by no drawing."""


@dataclass(frozen=True, slots=True)
class Review:
    """Sentences, and a row for each measured part."""

    lines: tuple[str, ...]
    parts: pd.DataFrame


@dataclass(frozen=True)
class Reopened:
    """The problem of a run, the design on its drawing, and the same problem with measured parts.

    `now` takes the means of the parts as they were measured, `reset` as the run's configuration
    does; `reset` is None where no allocation keeps the promise then. `since` uses earlier parts,
    where there are any. `made` are the parts with new values, `again` those of them with values among
    the earlier ones. `attributed` is the result of a gap analysis of the units themselves, `notes` say
    what of the files was left out.
    """

    before: ToleranceProblem
    design: dict[str, float]
    now: ToleranceProblem
    reset: ToleranceProblem | None
    made: tuple[str, ...]
    since: ToleranceProblem | None = None
    attributed: str = ""
    again: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def review(opened: Reopened) -> Review:
    """The review of a run's design by parts made to it."""
    before, design, now, reset, made = opened.before, opened.design, opened.now, opened.reset, opened.made
    promise = before.promise
    assert promise is not None
    full = _full_design(before, design)
    present = _full_design(now, design)
    lines = [
        f"promised: {promise.words()}",
        f"when it was promised, at the drawing's values: {_compliance(before, full)}",
        f"by the present parts: {_compliance(now, present)}",
        *(f"by the present parts the drawing breaks a limit: {broken}" for broken in _broken_limits(now, present)),
    ]
    least = Least.none(before)
    if reset is not None:
        least = cheapest_design(cheapest_at(reset, {}), _full_design(reset, design))
    if reset is not None and np.isfinite(least.cost):
        # standard deviations estimated from parts cost the same in both
        lines.append(_compare_costs(reset, least, float(reset.cost_of(_full_design(reset, design)[None, :])[0])))
    else:
        lines.append("no allocation keeps the promise by the present parts, even at the tightest tolerances")
    then, latest = characteristics(before), characteristics(now)
    shown = [name for name, measured in then.items() if name in made or not measured.fixed or measured.stated]
    saved = _savings(reset or before, design, least.design)
    rows = [
        _row(then[name], latest[name], design, least.design, name in made)
        | {"process": _new_process(now, then[name], design, least.design), "saving": saved[then[name].at]}
        for name in shown
    ]
    for name in made:
        sample = latest[name].sample
        lines += [f"{name} {finding.text}" for finding in (sample.findings if sample is not None else ())]
    if opened.since is not None:
        lines += _change_sentences(opened.since, now, opened.again, design)
    if opened.attributed:
        lines.append(f"the units' own measurement: {opened.attributed}")
    return Review(tuple(lines), pd.DataFrame(rows))


def _compare_costs(problem: ToleranceProblem, least: Least, cost: float) -> str:
    """The least cost by the present parts in comparison with the cost of the drawing."""
    currency = problem.settings.money.currency
    text = f"the least cost that keeps the promise now is {f'{least.cost:.4g} {currency}'.rstrip()}"
    now = f"with it {_compliance(problem, least.design)}"
    if not np.isfinite(cost):
        return f"{text}; what the drawing costs is not known, for no price of its values is stated; {now}"
    difference = f"{abs(cost - least.cost):.4g} {currency}".rstrip()
    change = f"saves {difference}" if least.cost < cost else f"costs {difference} more"
    percent = f"{100.0 * abs(1.0 - least.cost / cost):.2g} %" if cost > 0.0 else "the drawing is free"
    drawn = f"{cost:.4g} {currency}".rstrip()
    return f"{text}; the drawing costs {drawn}: a new allocation {change} ({percent}); {now}"


def _full_design(problem: ToleranceProblem, design: Mapping[str, float]) -> Array:
    """A full design (all variables,) with the tolerances of the drawing."""
    full = problem.corner(tight=True) if isinstance(problem, Stack) else problem.complete(problem.xl[None, :])[0]
    for at, name in enumerate(problem.names):
        full[at] = problem.fixed.get(name, float(design.get(name, full[at])))
    return full


def _savings(problem: ToleranceProblem, design: Mapping[str, float], new_design: Array) -> Array:
    """The saving (all,) of each value of a new design alone, from the cost of the drawing; that of a
    tolerance together with its process. NaN where it is not known.
    """
    full, names = _full_design(problem, design), problem.names
    changed = np.repeat(full[None, :], len(full), axis=0)
    np.fill_diagonal(changed, new_design)
    for at, name in enumerate(names):
        if (process := f"{name.removesuffix('_t')}_process") in names:
            changed[at, names.index(process)] = new_design[names.index(process)]
    known = np.isfinite(new_design)
    costs = np.full(len(full) + 1, np.nan)
    costs[0] = problem.cost_of(full[None, :])[0]
    costs[1:][known] = problem.cost_of(changed[known])
    costs[~np.isfinite(costs)] = np.nan
    return np.asarray(costs[0] - costs[1:])


def _new_process(
    problem: ToleranceProblem, part: Characteristic, design: Mapping[str, float], new_design: Array
) -> object:
    """The process of a part in a new design, where it is another than on the drawing; else NaN."""
    name = f"{part.tolerance.removesuffix('_t')}_process"
    if name not in problem.names:
        return np.nan
    at = problem.names.index(name)
    new, labels = new_design[at], problem.variables[at].labels
    same = not np.isfinite(new) or round(float(new)) == round(float(design.get(name, new)))
    return np.nan if same or not labels else labels[round(float(new))]


def _compliance(problem: ToleranceProblem, design: Array) -> str:
    """Yield by the estimates and assurance of a full design, the least of all requirements."""
    outputs, promise = problem.outputs_of(design[None, :]), problem.promise
    assert promise is not None
    least = {
        name: min(
            float(value[0]) for key, value in outputs.items() if key.split(".")[-1] == name and np.isfinite(value[0])
        )
        for name in (promise.of, ASSURANCE)
    }
    return (
        f"{least[promise.of]:.4g} % conform by the estimates, the promise is kept with a "
        f"probability of {least[ASSURANCE]:.1f} %"
    )


def _broken_limits(problem: ToleranceProblem, design: Array) -> list[str]:
    """The limits other than the promise that a full design (all,) breaks, each with its value."""
    outputs, of_promise = problem.outputs_of(design[None, :]), promised_limits(problem)
    sentences = []
    for limit in problem.limits:
        value = float(problem.values(design[None, :], outputs, limit.name)[0])
        within = np.isnan(value) or bool(limit.kept(np.array([value]))[0])
        if limit.name in of_promise or within:
            continue
        sentences.append(f"{limit.name} is {value_against_limit(value, limit)}")
    return sentences


@dataclass(frozen=True, slots=True)
class Characteristic:
    """What may be measured: the place of its tolerance among the variables, its sample and Cp."""

    name: str
    unit: str
    at: int
    tolerance: str
    sample: PartSample | None
    cp: float
    fixed: bool
    stated: bool = False


def characteristics(problem: ToleranceProblem) -> dict[str, Characteristic]:
    """The parts of a stack, or the tolerances of another problem, by name."""
    by_name = {}
    if isinstance(problem, Stack):
        for part in problem.definition.parts:
            t, cp = f"{part.name}_t", np.nan if part.one_sided else 1.0 / (3.0 * std_of(part.distribution))
            at = problem.names.index(t)
            by_name[part.name] = Characteristic(part.name, part.unit, at, t, part.sample, cp, part.fixed, stated=True)
        return by_name
    for at, v in enumerate(problem.variables):
        setting = problem.settings.variables[v.name]
        if v.tolerance and not v.integer:
            law = None if setting.sample is not None and setting.sample.one_sided else setting.distribution
            cp = np.nan if law is None else 1.0 / (3.0 * std_of(law))
            by_name[v.name] = Characteristic(v.name, v.unit, at, v.name, setting.sample, cp, v.name in problem.fixed)
    return by_name


def _row(
    then: Characteristic, now: Characteristic, design: Mapping[str, float], new_design: Array, made: bool
) -> dict[str, object]:
    """What changed of a characteristic, and what its tolerance should be."""
    new, sample = float(new_design[then.at]), now.sample
    t = float(design.get(then.tolerance, new))
    advice = "keep"
    if not np.isfinite(new):
        advice = "unknown"
    elif abs(new / t - 1.0) > ZONE_TOLERANCE:
        advice = AS_MADE if now.fixed and made else ("loosen" if new > t else "tighten")
    return {
        "part": then.name,
        "unit": then.unit,
        "parts": sample.parts if made and sample is not None else 0,
        "cp_then": then.cp,
        "cp_now": now.cp,
        "offset": np.nan if not made or sample is None or sample.one_sided else sample.knowledge.mean,
        "tolerance": t,
        "new_tolerance": new,
        "advice": advice if not then.fixed or advice == AS_MADE else "keep",
    }


def _change_sentences(
    since: ToleranceProblem, now: ToleranceProblem, made: Sequence[str], design: Mapping[str, float]
) -> list[str]:
    """Sentences on the differences of the parts from the earlier ones."""
    lines = [f"by the earlier parts: {_compliance(since, _full_design(since, design))}"]
    earlier, latest = characteristics(since), characteristics(now)
    for name in made:
        old, new = earlier[name].sample, latest[name].sample
        if old is None or new is None or old is new:
            continue
        a, b = old.deviations, new.deviations
        if not (len(a) and len(b)):
            continue  # a supplier's mean and standard deviation
        ratio = float(np.var(b, ddof=1) / np.var(a, ddof=1))
        tail = float(stats.f.cdf(ratio, len(b) - 1, len(a) - 1))
        scatter = f"{name} scatters {np.sqrt(ratio):.2g} times as much as the earlier parts"
        mean = f"the mean of {name} moved by {float(b.mean() - a.mean()):+.4g} {latest[name].unit}"
        chances = {scatter: 2.0 * min(tail, 1.0 - tail), mean: float(stats.ttest_ind(b, a, equal_var=False).pvalue)}
        lines += [f"{text} (by chance: {chance:.2g})" for text, chance in chances.items() if chance < CHANGED]
    return lines
