"""What a run says: its choices, its answers in sentences, what assumptions cost, its promise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ...algorithms.exact.bounds import Proof
from ...algorithms.exact.descent import FEW_UNITS
from ...algorithms.exact.local import NEARLY, Branch
from ...algorithms.exact.solver import closed_form
from ...algorithms.run import Progress, Run, Shared, recalled_results
from ...algorithms.settings import Budget
from ...problems.limits import Limit
from ...problems.settings import Bound
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...records import FORMAT, Axis, RunResult
from ...section import Array, Kind, number
from ...units import drawing_number, plain_number
from .changes import step_words, value_against_limit, words
from .choice import ALL
from .decide import Decisions
from .plan import MAX_LIMIT_DISTANCE, RunPlan, chosen_point, shown_point
from .prices import ERRORS, PERCENT, points_at_limit
from .promise import (
    capability_table,
    cheapest_at,
    cheapest_design,
    promise_outcome,
    promised_limits,
    worth_of_corrections,
)
from .proofs import EXACT, ProvenFront, are_informative_bounds, costs_less, distance_words, exact_table, percent
from .references import gain_column

# The choices of a front, as parts of the result of a run.


SMALL_STEP = 1e-4
"""Fraction of a range by which what is searched is moved to see whether that breaks a limit."""
IDLE = "The limit of {} is met exactly, and no small step of what is searched breaks it."
NEAR = (
    f"At this allocation {{}} lies within {ERRORS:g} standard errors of its limit, {{}}; what loosening it would save "
    "is not known."
)


def add_choices(result: RunResult, decisions: Decisions, plan: RunPlan, exact: ProvenFront | None) -> RunResult:
    """The result with its choices, and with all that the page needs in the summary."""
    summary = dict(result.summary) | {
        "choices": _summarise_choices(decisions.choices, plan.problem),
        "rounding": _rounding(decisions, plan),
        "format": FORMAT,
        "title": result.title,
        **_mechanism(plan.problem),
        "axes": {"objectives": _axes(result.objectives), "variables": _axes(result.variables)},
        "bars": [asdict(bar) for bar in result.bars],
    }
    return replace(
        result,
        summary=summary,
        choices=_none_if_empty(decisions.choices),
        choice_sensitivity=_none_if_empty(decisions.sensitivity),
        allocation=_none_if_empty(decisions.allocation),
        contributions=_none_if_empty(decisions.contributions),
        prices=_none_if_empty(decisions.prices),
        changes=_none_if_empty(decisions.changes),
        tolerances=decisions.tolerances,
        exact_front=exact_table(plan.problem, exact),
    )


def _mechanism(problem: ToleranceProblem) -> dict[str, object]:
    """The stated properties of the mechanism; empty where nothing but its name is stated."""
    known = problem.mechanism()
    return {"mechanism": known} if set(known) - {"name"} else {}


def _summarise_choices(choices: pd.DataFrame, problem: ToleranceProblem) -> dict[str, object]:
    """By rule: the row of the front, its objectives, and what rounding does to them."""
    columns = ["point", "meaning", *problem.objectives, "rounded_feasible", "unchanged_percent"]
    columns += [f"rounded_{name}" for name in problem.objectives]
    columns += ["model"] if "model" in choices else []
    return {str(row["choice"]): {name: row[name] for name in columns} for row in choices.to_dict("records")}


def _rounding(decisions: Decisions, plan: RunPlan) -> list[dict[str, str]]:
    """How each variable is rounded, and whether the configuration says so."""
    stated = set(plan.choice.steps)
    stated |= {v.name for v in plan.problem.free if v.tolerance and not v.integer} if ALL in stated else set()
    return [
        {"variable": name, "rule": rule, "set_by": "configuration" if name in stated else "default"}
        for name, rule in decisions.rounding.items()
    ]


def _axes(axes: tuple[Axis, ...]) -> list[dict[str, str]]:
    return [asdict(axis) for axis in axes]


def _none_if_empty(frame: pd.DataFrame) -> pd.DataFrame | None:
    return None if frame.empty else frame


COST = "cost"
COST_TOLERANCE = 1e-9
"""Relative difference below which two values count as equal."""
TENTH = 0.1
"""Fraction of a limit by which it is loosened, to state what that saves."""
RELAXATION_FRACTION = 0.01
"""The same where its price is known alone, which holds for small changes."""


def answers(result: RunResult, problem: ToleranceProblem, proven: Proof) -> dict[str, str]:
    """`asked`, `found`, `published`, `limits`, `rounding`, `loosen` and `proof`: a sentence or two each.

    `proven` are the bounds of the front. Only `asked` where the front is empty; `published` where a
    document prints an allocation, `loosen` where single steps of the tolerances were tried.
    """
    sentences = Sentences(result, problem, proven)
    asked = {"asked": sentences.request()}
    if result.front.empty:
        return asked
    stated = {
        "found": sentences.outcome(),
        "published": sentences.published(),
        "limits": sentences.of_limits(),
        "rounding": sentences.first_choice("rounding"),
        "loosen": sentences.first_choice("loosen_first"),
        "proof": sentences.proof(),
    }
    return asked | {name: text for name, text in stated.items() if text}


class Sentences:
    """The sentences of one run."""

    def __init__(self, result: RunResult, problem: ToleranceProblem, proven: Proof) -> None:
        self.result, self.problem, self.proven = result, problem, proven
        self.units = {o.name: o.unit for o in problem.outputs}
        self.units |= {v.name: v.unit for v in problem.variables}
        self.units[COST] = problem.settings.money.currency
        self.priced = problem.priced
        self.names = list(problem.objectives)
        self.point = chosen_point(result)

    def value(self, name: str, value: float) -> str:
        """Like "backlash 1.04 arcmin"."""
        return f"{words(name)} {plain_number(value)} {self.units.get(name, '')}".rstrip()

    def row(self, row: Any, names: list[str] | None = None) -> str:
        return ", ".join(self.value(name, float(row[name])) for name in names or self.names)

    # ------------------------------------------------------------------ sentences

    def request(self) -> str:
        largest = {o.name for o in self.problem.outputs if o.larger_is_better}
        goals = [f"{'largest' if n in largest else 'least'} {words(n)}" for n in self.names]
        goal = " against ".join(goals).capitalize()
        requested = set(self.problem.given.limits or self.problem.declaration.limits) | promised_limits(self.problem)
        limits = [self.limit(limit) for limit in self.problem.limits if limit.count and limit.name in requested]
        built_in = sum(limit.count > 0 for limit in self.problem.limits) - len(limits)
        if built_in > 0:
            plural = "limit" if built_in == 1 else "limits"
            limits.append(f"{built_in} {plural} that the problem sets itself")
        conditions = f", with {', '.join(limits)}" if limits else ", without limits"
        tolerances = sum(v.tolerance for v in self.problem.free)
        others = len(self.problem.free) - tolerances
        variables = f"variable{'' if others == 1 else 's'}"
        searched = f"{tolerances} tolerance{'' if tolerances == 1 else 's'} searched"
        if not tolerances:
            searched = f"{others} {variables} searched"
        elif others:
            searched += f" and {others} other {variables}"
        return f"{goal}{conditions}; {searched}."

    def limit(self, limit: Limit) -> str:
        unit = f" {limit.unit}".rstrip()
        ends = [f"at least {drawing_number(limit.low)}{unit}"] if np.isfinite(limit.low) else []
        ends += [f"at most {drawing_number(limit.high)}{unit}"] if np.isfinite(limit.high) else []
        return f"{words(limit.name)} {' and '.join(ends)}"

    def outcome(self) -> str:
        front = self.result.front
        row = front.iloc[self.point]
        if len(front) == 1:
            limited = [o.name for o in self.problem.limits if o.name in front and o.name not in self.names]
            more = f" (with {self.row(row, limited)})" if limited else ""
            return f"Found: {self.row(row)}{more}."
        ends = ", ".join(
            f"{words(n)} {plain_number(front[n].min())} to {self.value('', float(front[n].max())).strip()}"
            for n in self.names
        )
        choices = self.result.choices
        rule = "" if choices is None or choices.empty else str(choices["choice"].iloc[0])
        named = words(rule) if rule.startswith("knee") else f"choice by {words(rule)}" if rule else "chosen one"
        return f"Found: {len(front)} allocations, {ends}; the {named} has {self.row(row)}."

    def published(self) -> str:
        printed = [str(label) for label in self.problem.references()]
        for row in self.result.references.to_dict("records"):
            if row["label"] in printed:
                return self._comparison({str(name): value for name, value in row.items()})
        return ""

    def _comparison(self, row: dict[str, Any]) -> str:
        label, broken = str(row["label"]), str(row["violated_limits"]).split()
        published = f"The published allocation ({label}) has {self.row(row)}"
        if broken:
            values = ", ".join(f"{words(n)} {value_against_limit(float(row[n]), self._limit(n))}" for n in broken)
            gains = self._gains(row, "relaxed_")
            if not gains:
                return f"{published}, but breaks the limits ({values}): it cannot be compared."
            return f"{published}, but breaks the limits ({values}): at the same looser limits {gains}."
        gains = self._gains(row, "")
        if gains:
            return f"{published} and keeps all limits: {gains}."
        return f"{published} and keeps all limits; no point of the front is as good in every other objective."

    def _limit(self, name: str) -> Limit:
        return next(limit for limit in self.problem.limits if limit.name == name)

    def _gains(self, row: dict[str, Any], prefix: str) -> str:
        better, worse = [], []
        for name in self.names:
            value = float(row.get(prefix + gain_column(name), np.nan))
            if not np.isfinite(value):
                continue
            amount = distance_words(abs(value))
            if len(self.names) == 1:
                return f"the least {words(name)} that was found is {amount} {'lower' if value >= 0.0 else 'higher'}"
            others = join_with_and([words(n) for n in self.names if n != name])
            at = "the same cost" if others == COST else f"equal {others}"
            if value >= 0.0:
                subject = "an allocation that costs" if name == COST else f"a {words(name)} that is"
                better.append(f"{subject} {amount} less at {at}")
            else:
                worse.append(f"the least {words(name)} that was found is {amount} more at {at}")
        return "; ".join([*(["there is " + ", or ".join(better)] if better else []), *worse])

    def of_limits(self) -> str:
        limits = [o for o in self.problem.limits if o.count and o.name != self.priced]
        row = self.result.front.iloc[[self.point]]
        if not limits:
            for cost in (o for o in self.problem.limits if o.name == self.priced):
                how = "binds" if points_at_limit(cost, row)[0] else "is kept with a margin"
                return f"{self._here} the limit of {self.limit(cost)} {how}."
            return "No limits are set in addition to the objectives."
        held = [o for o in limits if points_at_limit(o, row)[0]]
        unmoved = [o for o in held if len(set(self.problem.interval(o.name))) == 1]
        exactly = "What is fixed meets the limit of {} exactly: no allocation moves it."
        saved = {o.name: exactly.format(self.limit(o)) for o in unmoved}
        if held == unmoved:
            moved = [o.name for o in limits if o not in unmoved]
            which = "every other limit" if unmoved else "every limit"
            margin = f"{self._here} {which} is kept with a margin{self._held_back(moved)}." if moved else ""
            return " ".join(filter(None, (margin, *saved.values())))
        held = [o for o in held if o not in unmoved]
        saved |= {limit.name: self._cost_of(limit) for limit in held}
        idle = [limit for limit in held if not saved[limit.name] and not self._moves(limit)]
        saved |= {limit.name: IDLE.format(self.limit(limit)) for limit in idle}
        exact = {o.name: row.assign(**{f"{o.name}_error": 0.0}) for o in held}
        for o in (o for o in held if not saved[o.name] and not points_at_limit(o, exact[o.name])[0]):
            end = self.limit(o).removeprefix(words(o.name)).strip()
            saved[o.name] = NEAR.format(self.value(o.name, float(row[o.name].iloc[0])), end)
        unknown = [self.limit(limit) for limit in held if not saved[limit.name]]
        if unknown:
            plural = ("limit of", "binds", "it") if len(unknown) == 1 else ("limits of", "bind", "them")
            what = f"{self._here} the {plural[0]} {join_with_and(unknown)} {plural[1]}"
            priced = self.priced in self.result.front
            saved[""] = f"{what}; what loosening {plural[2]} would save is not known." if priced else f"{what}."
        return " ".join(filter(None, saved.values()))

    @property
    def _here(self) -> str:
        return "At this allocation"

    @property
    def _cost(self) -> float:
        return float(self.result.front.iloc[self.point].get(self.priced, np.nan))

    def money(self, amount: float) -> str:
        return f"{plain_number(amount, 3)} {self.units[self.priced]}".rstrip()

    def _held_back(self, limits: list[str]) -> str:
        """What is known of limits that a point keeps with a margin: what the cost is without them,
        which single steps they forbid, or that it is not known.
        """
        none = f", and none adds to the {words(self.priced)}"
        if self._cost <= self.floor + COST_TOLERANCE * abs(self._cost):
            cheaper = "is cheaper" if self.priced == COST else costs_less(self.problem)
            return f"{none}: nothing in the ranges {cheaper}"
        within, without = self._solved({}), self._solved(dict.fromkeys(limits, Bound()))
        if within is not None and without is not None and within - without <= EXACT / 100.0 * abs(within):
            return f"{none} (solved without them)"
        tried = self._tried() if self.priced == COST else pd.DataFrame()
        blocked = tried[(tried["breaks"] != "") & (tried["cost_change"] < 0.0)] if len(tried) else tried
        if within is not None and without is not None:
            return f", but without them the least cost would be {self.money(within - without)} lower"
        if len(blocked):
            step = blocked.sort_values("cost_change", kind="stable").iloc[0].to_dict()
            saved = self.money(-float(step["cost_change"]))
            return f", but they hold steps back: {step_words(step)}, would save {saved}, and breaks {step['broken']}"
        return f"; whether one of them adds to the {words(self.priced)} is not known"

    @property
    def floor(self) -> float:
        """The least cost of the ranges, whatever the limits; -inf where it is not known."""
        return float(self.problem.interval(self.priced)[0])

    def _tried(self) -> pd.DataFrame:
        """The single steps that were tried at the point."""
        tried = self.result.changes
        return pd.DataFrame() if tried is None else tried[tried["point"] == self.point]

    def first_choice(self, column: str) -> str:
        """What a column of the choices says of the first one; empty where there is none."""
        choices = self.result.choices
        return "" if choices is None or choices.empty or column not in choices else str(choices[column].iloc[0])

    def _solved(self, limits: Mapping[str, Bound]) -> float | None:
        """The least cost with other limits at the point's other objectives; None where it has no
        closed form that solves it.
        """
        row = self.result.front.iloc[self.point]
        levels = {name: float(row[name]) for name in self.names if name != COST}
        if COST not in self.names or set(limits) & promised_limits(self.problem):
            return None
        relaxed = cheapest_at(self.problem.relaxed(limits), {n: v + COST_TOLERANCE * abs(v) for n, v in levels.items()})
        if not any(limit.count for limit in relaxed.limits):
            return self.floor
        form = closed_form(relaxed)
        if form is None or not form.exact:
            return None
        cost = cheapest_design(relaxed).cost
        return cost if np.isfinite(cost) else None

    def _cost_of(self, limit: Limit) -> str:
        """What loosening a limit that binds would save; empty where it is not known."""
        binds = f"{self._here} the limit of {self.limit(limit)} binds"
        lower = float(self.result.front.iloc[self.point][limit.name]) - limit.low < self._above(limit)
        step = _step(limit, lower)
        end = limit.low - step if lower else limit.high + step
        looser = Bound(end, limit.high) if lower else Bound(limit.low, end)
        unit = f" {limit.unit}".rstrip()
        change = f"{'lowering' if lower else 'raising'} it to {drawing_number(end)}{unit}"
        now, then = (self._solved({limit.name: bound}) for bound in (Bound(limit.low, limit.high), looser))
        if now is not None and then is not None:
            saved = self.money(now - then) if now - then > EXACT / 100.0 * abs(now) else "nothing"
            return f"{binds}: {change} would save {saved} (solved again)."
        priced = self._price(limit.name)
        if priced is not None:
            price, how = priced
            small = _step(limit, lower, RELAXATION_FRACTION)
            change = f"{'lowering' if lower else 'raising'} it by {drawing_number(small)}{unit}"
            if price * small <= max(self._cost - self.floor, 0.0):
                return f"{binds}: {change} would save about {self.money(price * small)} ({how})."
        return self._relaxed(limit.name)

    def _moves(self, limit: Limit) -> bool:
        """Whether a small step of something that is searched breaks a limit that is met exactly."""
        problem, value = self.problem, float(self.result.front.iloc[self.point][limit.name])
        ends = [end for end in (limit.low, limit.high) if np.isfinite(end)]
        if problem.declaration.sampled or all(abs(value - end) > limit.room(end) for end in ends):
            return True
        design = designs_of(problem, self.result.front.iloc[[self.point]])
        at = [problem.names.index(v.name) for v in problem.free]
        whole = np.array([variable.integer for variable in problem.free], dtype=bool)
        steps = np.where(whole, 1.0, SMALL_STEP * (problem.xu - problem.xl))
        moved = np.concatenate([design[:, at] + np.diag(steps), design[:, at] - np.diag(steps)])
        designs = problem.complete(np.clip(moved, problem.xl, problem.xu))
        return not limit.kept(problem.values(designs, problem.needed_outputs(designs), limit.name)).all()

    def _above(self, limit: Limit) -> float:
        return limit.high - float(self.result.front.iloc[self.point][limit.name])

    def _price(self, name: str) -> tuple[float, str] | None:
        """The price of a limit at the nearest point that has one, and how it is known."""
        prices = self.result.prices
        if prices is None:
            return None
        of_limit = prices[prices["output"] == name]
        if of_limit.empty:
            return None
        row = of_limit.iloc[int((of_limit["point"] - self.point).abs().to_numpy().argmin())]
        if not row["price"] > 0.0:
            return None
        proven = row["source"] == "multiplier"
        estimated = f"estimated by the conditions of an optimum, met to within {percent(row['spread_percent'])}"
        return float(row["price"]), "by the multiplier of the proven optimum" if proven else estimated

    def _relaxed(self, name: str) -> str:
        """What a front with a looser limit saves at the other objectives of the point."""
        relaxed, row = self.result.relaxed, self.result.front.iloc[self.point]
        if relaxed is None or COST not in self.names:
            return ""
        for label, front in relaxed.groupby("label", sort=False):
            reference = self.result.references.set_index("label")
            if str(reference["violated_limits"].get(label, "")) != name:
                continue
            others = [n for n in self.names if n != COST]
            good = np.ones(len(front), dtype=bool)
            for n in others:
                good &= front[n].to_numpy(dtype=float) <= float(row[n]) + COST_TOLERANCE * abs(float(row[n]))
            if np.any(good):
                saved = float(row[COST]) - float(front.loc[good, COST].min())
                loose = self.value(name, float(reference[name][label]))
                return (
                    f"{self._here} the limit of {self.limit(self._limit(name))} binds: with one as loose as that of "
                    f"{label} ({loose}) an allocation was found that costs {self.money(saved)} "
                    f"({percent(100.0 * saved / float(row[COST]))}) less."
                )
        return ""

    def proof(self) -> str:
        proven = self.proven
        gap = self.result.front["gap_percent"].to_numpy(dtype=float)
        if np.all(np.isnan(gap)):
            why = proven.missing or proven.statement or f"there is no bound of the {words(self.priced)}"
            return f"How far the points are from the optimum is not proven ({why})."
        if not are_informative_bounds(self.problem, proven, gap):
            return (
                "How far the points are from the optimum is not known: the proven bound is not informative, because it "
                f"leaves out limits that hold them back ({proven.statement})."
            )
        below = 100.0 * gap / (100.0 + gap)  # a gap is in percent of the bound
        middle, most = float(np.nanmedian(below)), float(np.nanmax(below))
        at, less = self._at_equal_requirements(), costs_less(self.problem)
        if len(gap) == 1 and most < EXACT:
            return f"Proven: this is the least {words(self.problem.priced)} within the limits{at} ({proven.statement})."
        if len(gap) == 1:
            return (
                f"Proven: no allocation within the limits{at} {less} than {percent(most)} "
                f"below this one ({proven.statement})."
            )
        if most < EXACT:
            return f"Proven: every point of the front is optimal{at} ({proven.statement})."
        return (
            f"Proven: no allocation of equal other objectives{at} {less} than {percent(middle)} below a point of "
            f"the front in the median, {percent(most)} at most ({proven.statement})."
        )

    def _at_equal_requirements(self) -> str:
        """What a bound holds at, beside the limits: the requirements that stand for an output of the run."""
        form = self.problem.priced_form()
        asked = {*self.names, *(limit.name for limit in self.problem.limits if limit.count)}
        standing = [words(row) for row, name in form.stands.items() if name in asked] if form is not None else []
        return f" at equal {join_with_and(standing)}" if standing else ""


def join_with_and(texts: list[str]) -> str:
    """Like "a, b and c"."""
    return " and ".join([*([", ".join(texts[:-1])] if len(texts) > 1 else []), texts[-1]])


def _step(limit: Limit, lower: bool, part: float = TENTH) -> float:
    """A part of the distance of a limit from zero, or of a least percentage from 100 %."""
    end = limit.low if lower else limit.high
    remaining = 100.0 - end if lower and limit.unit in PERCENT and end < 100.0 else np.inf
    return float(f"{min(abs(end), remaining) * part:.2g}") or limit.scale * part


# What the assumptions of a run cost: its least cost with one of them changed at a time.


INFEASIBLE = "no allocation found that keeps the limits at this grade"
TOGETHER = 4
"""Costs that are computed side by side, and stored together for a run that resumes."""
RIGID = "backlash_"
"""Prefix of the outputs that are searched within a fraction of a second."""


def _is_rigid(name: str) -> bool:
    """Whether an output, in a condition or not, is one of these."""
    return name.rpartition(".")[2].startswith(RIGID)


def add_assumptions(
    result: RunResult,
    problem: ToleranceProblem,
    history: Sequence[Progress],
    progress: Callable[[Progress], None] | None,
    shared: Shared | None = None,
) -> RunResult:
    """The result with the table of its shown point; `progress` continues `history`."""
    chosen = shown_point(result.front, problem)
    if chosen is None:
        return result

    def phase(fraction: float) -> None:
        if progress is not None and history:
            progress(replace(history[-1], phase="what assumptions cost", share=fraction, remaining=None))

    point = result.front.iloc[[chosen[0]]]
    level = _aim(point, problem)
    ends = [np.array([result.summary[end][name] for name in problem.objectives]) for end in ("ideal", "nadir")]
    unit = np.maximum(ends[1] - ends[0], 1e-12)
    more = np.zeros(len(unit))
    if level is not None and level[0] in problem.objectives:
        more[problem.objectives.index(level[0])] = level[1] - float(point[level[0]].iloc[0])
    table = assumptions_cost(problem, designs_of(problem, point)[0], unit, more, phase, shared)
    if table is None:
        return result
    summary = {**result.summary, "assumptions_at": _held_outputs(point, problem, level)}
    return replace(result, assumptions_cost=table, summary=summary)


def _aim(point: pd.DataFrame, problem: ToleranceProblem) -> tuple[str, float] | None:
    """The problem's limit where the point is near to it: the level of all costs."""
    limit = problem.shown_limit()
    if limit is None or limit[0] not in point:
        return None
    return limit if abs(float(point[limit[0]].iloc[0]) / limit[1] - 1.0) <= MAX_LIMIT_DISTANCE else None


def _held_outputs(point: pd.DataFrame, problem: ToleranceProblem, level: tuple[str, float] | None) -> dict[str, float]:
    """The outputs that are held, with their values as they are reported."""
    held = [name for name in problem.objectives if name != "cost"]
    outputs = {name: float(point[name].iloc[0]) for name in held}
    if not held:
        outputs = {
            limit.name: problem.settings.limits[limit.name].high for limit in problem.limits if _is_rigid(limit.name)
        }
    return {name: level[1] if level and level[0] == name and held else value for name, value in outputs.items()}


def assumptions_cost(
    problem: ToleranceProblem,
    design: Array,
    unit: Array,
    more: Array,
    phase: Callable[[float], None] = lambda fraction: None,
    shared: Shared | None = None,
) -> pd.DataFrame | None:
    """Least cost at the other objective's level of a full design (all variables,), by assumption.

    The first row is the problem as it is. All are solved on the sample of the search, from the
    design, at its integers; `unit` (m,) is the scale of the objectives, `more` (m,) is what is
    added to the levels of the design. `phase` is called with the fraction that is done; `shared` computes
    some of the costs in other processes. None where
    these costs are not defined: another problem than cost against backlash, least cost without a
    limit on backlash, or no allocation even without a change.
    """
    if not _applies(problem):
        return None
    variants, free = problem.variants(), [problem.names.index(v.name) for v in problem.free]
    x = np.clip(design[free], problem.xl, problem.xu)
    branch = Branch(Run(variants[0].problem, Budget(), seed=0), x, unit)
    limit = _level(branch, x) + more
    base = _least(branch, x, limit)
    variants[0].problem.release()
    if np.isnan(base):
        return None
    costs, results = [base], shared or Run(problem, Budget(), seed=0).results
    while len(costs) < len(variants):
        phase(len(costs) / len(variants))
        tasks = [Assumed(at, x, unit, limit) for at in range(len(costs), min(len(costs) + TOGETHER, len(variants)))]
        inputs = (np.array([task.at for task in tasks]), x, unit, limit)
        costs.extend(recalled_results(results, cost_of_variant, tasks, inputs).tolist())
    phase(1.0)
    rows: list[dict[str, Any]] = [
        {
            "assumption": variant.assumption,
            "value": variant.value,
            "cost": cost,
            "change_percent": 100.0 * (cost / base - 1.0),
            "remark": INFEASIBLE if np.isnan(cost) else "",
        }
        for variant, cost in zip(variants, costs, strict=True)
    ]
    if any(variant.parts for variant in variants):
        _add_worth_of_measuring(rows, [variant.parts for variant in variants])
    lost = [row for row, variant in zip(rows, variants, strict=True) if variant.true_costs]
    if known := [row["change_percent"] for row in lost if not np.isnan(row["cost"])]:
        text = (
            f"with costs wrong by factors of 2 the allocation loses {max(known):.1f} % at most; the cost is not known"
        )
        lost[0]["remark"] = text
    return pd.DataFrame(rows) if len(rows) > 1 else None


def _add_worth_of_measuring(rows: list[dict[str, Any]], parts: Sequence[int]) -> None:
    """What each assumption, if a measurement shows it, saves for each measured part; the most is remarked on."""
    for row, count in zip(rows, parts, strict=True):
        saved = max(0.0, -row["change_percent"])
        row |= {"measured_parts": count, "saved_percent_per_part": saved / count if count else np.nan}
    first = max(rows, key=lambda row: np.nan_to_num(row["saved_percent_per_part"]))
    if first["saved_percent_per_part"] > 0.0:
        first["remark"] = "measure this first: it may save the most for each part that is measured"


def _applies(problem: ToleranceProblem) -> bool:
    """Whether the run asks for cost against backlash, or for least cost at a backlash."""
    others = [name for name in problem.objectives if name != "cost"]
    if len(problem.objectives) != len(others) + 1 or not problem.declaration.sampled:
        return False
    if others:
        return len(others) == 1 and _is_rigid(others[0])
    return any(_is_rigid(limit.name) for limit in problem.limits)


class Assumed(NamedTuple):
    """A variant of a problem by its place, the search vector x to begin from, the scale of the objectives
    and the limits (m,) on them.
    """

    at: int
    x: Array
    unit: Array
    limit: Array


def cost_of_variant(problem: ToleranceProblem, task: Assumed) -> float:
    """Least cost of a problem with one assumption changed; NaN where nothing keeps the limits."""
    variant, vectors = problem.variants()[task.at], [task.x]
    for at, variable in enumerate(problem.free):
        if variant.regraded and variable.kind is Kind.GRADE:
            grades = np.arange(np.ceil(problem.xl[at]), np.floor(problem.xu[at]) + 1.0)
            vectors = [np.where(np.arange(len(task.x)) == at, grade, task.x) for grade in grades]
    costs = []
    for x in vectors:
        branch = Branch(Run(variant.problem, Budget(), seed=0), x, task.unit)
        cost = _least(branch, x, task.limit)
        if variant.true_costs and not np.isnan(cost):
            at = [values[problem.objectives.index("cost")] for values in branch.f].index(cost)
            cost = float(problem.cost_of(problem.complete(branch.smooth.vectors(branch.y[at][None, :])))[0])
        costs.append(cost)
    return min((cost for cost in costs if not np.isnan(cost)), default=np.nan)


def _level(branch: Branch, x: Array) -> Array:
    """The level (m,) of the objectives but the cost, at a search vector on the search's sample."""
    limit = branch.smooth.values(branch.smooth.scaled(x[None, :])[0])[0].copy()
    limit[branch.smooth.run.problem.objectives.index("cost")] = np.inf
    return limit


def _least(branch: Branch, x: Array, limit: Array) -> float:
    """Least cost within the limits, begun at `x`, and at the problem's own starts where that keeps them not, or where
    the sample has so few units that SLSQP may end on a kink, at which of them the last digit decides; or NaN.
    """
    run = branch.smooth.run
    cost = run.problem.objectives.index("cost")
    least = _least_value(branch, cost, branch.smooth.scaled(x[None, :])[0], limit)
    few_units = any(number(size) <= FEW_UNITS for size in run.problem.sample_sizes().values())
    if not (few_units or np.isnan(least)):
        return least
    ends = [least, *(_least_value(branch, cost, start, limit) for start in branch.starts(run))]
    return min((value for value in ends if not np.isnan(value)), default=np.nan)


def _least_value(branch: Branch, cost: int, start: Array, limit: Array) -> float:
    values = branch.minimise(cost, start, limit)
    if values is None or np.any(values > limit + NEARLY * branch.unit):
        return np.nan
    return float(values[cost])


# The promise of a run and what is known of measured parts, as parts of its result.


def add_capability(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with what is known of measured parts, where there are some."""
    if not problem.samples():
        return result
    result = replace(result, capability=capability_table(problem))
    worth = worth_of_corrections(problem, result.front, chosen_point(result))
    if not worth:
        return result
    answers = dict(result.answers) | {"corrections": worth}
    return replace(result, summary=dict(result.summary) | {"answers": answers})


def rounded_design(result: RunResult, problem: ToleranceProblem, point: int) -> Array | None:
    """The full design (all variables,) of a point with the values of its drawing, if it has one."""
    allocation = result.allocation
    if allocation is None or result.front.empty or point not in set(allocation["point"]):
        return None
    row, first = result.front.iloc[[point]].copy(), allocation[allocation["point"] == point].drop_duplicates("variable")
    for name, value in zip(first["variable"], first["rounded"], strict=True):
        if name in problem.names and pd.notna(value):
            row[name] = value  # a number, or the name of a process or grade
    return np.array(designs_of(problem, row)[0])


BEFORE, CHOSEN = "before: as drawn, else loosest", "chosen, rounded"
"""The tolerances that the requirements of a run are analysed at."""


def add_analysis(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with its requirements as drawn now, else at the loosest tolerances, and at the first
    choice, as rounded for the drawing; unchanged where the problem has no such table or nothing is chosen.
    """
    design = rounded_design(result, problem, chosen_point(result))
    before = None if design is None else problem.requirements_at()
    if before is None or (after := problem.requirements_at(design)) is None:
        return result
    together = pd.concat([before, after], ignore_index=True)
    together.insert(0, "tolerances", [BEFORE] * len(before) + [CHOSEN] * len(after))
    return replace(result, analysis=together)


def add_promise(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with its promise at the knee or at the only point, where a promise is made."""
    if not promised_limits(problem):
        return result
    point = chosen_point(result)
    outcome = promise_outcome(problem, result.front, point, rounded_design(result, problem, point))
    if outcome is None:
        return result
    answers = dict(result.answers) | {"promise": outcome.sentence}
    summary = dict(result.summary) | {"promise": outcome.summary, "answers": answers}
    return replace(
        result,
        summary=summary,
        promise=outcome.costs if len(outcome.costs) else None,
        next_parts=outcome.next_parts if len(outcome.next_parts) else None,
    )
