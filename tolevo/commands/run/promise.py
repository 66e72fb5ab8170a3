"""Promises of a run on measured parts: their least cost, whether they hold, what to measure next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy.special import ndtri

from ...algorithms.exact.bounds import row_limits
from ...algorithms.exact.choices import least_cost
from ...algorithms.exact.combination import Optimum
from ...algorithms.exact.epsilon import SETS, feasible_afresh, scale_of
from ...algorithms.exact.local import Branch
from ...algorithms.exact.solver import Exact, closed_form
from ...algorithms.hybrid import Hybrid
from ...algorithms.run import Run
from ...algorithms.search import search
from ...algorithms.settings import Budget
from ...models.capability import Knowledge, PartSample, draw_cumulants, fraction_within_limits
from ...problems.forms import Form, spread_of
from ...problems.limits import descending, loosened
from ...problems.settings import ASSURANCE, ASSURED, PROMISED, STATEMENTS, YIELD, Bound, Promise, VariableSetting
from ...problems.stack import Stack, promises
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...section import Array, Kind
from .prices import prices, slopes_of

# The same problem with another promise, at other levels, or with more known of its processes.


def with_statement(problem: ToleranceProblem, statement: str) -> ToleranceProblem:
    """The problem with the same promise in the sense of another statement."""
    if isinstance(problem, Stack):
        return promises.with_statement(problem, statement)
    promise = problem.given.promise
    assert promise is not None
    return type(problem)(replace(problem.given, promise=replace(promise, statement=statement)))


def cheapest_at(problem: ToleranceProblem, levels: Mapping[str, float]) -> ToleranceProblem:
    """Least cost alone, with upper limits on outputs in addition to the limits of the problem."""
    if isinstance(problem, Stack):
        return promises.least_cost_at_limits(problem, levels)
    limits = dict(problem.given.limits)
    for name, high in levels.items():
        limits[name] = replace(limits.get(name, Bound()), high=high)
    return type(problem)(replace(problem.given, objectives=("cost",), limits=limits))


def known_of(problem: ToleranceProblem) -> dict[str, Knowledge]:
    """What is known of parts or variables from their samples, by name."""
    if isinstance(problem, Stack):
        return {part.name: part.sample.knowledge for part in problem.definition.parts if part.sample is not None}
    return {
        name: setting.sample.knowledge
        for name, setting in problem.settings.variables.items()
        if setting.sample is not None
    }


def with_knowledge(problem: ToleranceProblem, known: Mapping[str, Knowledge]) -> ToleranceProblem:
    """The problem with other knowledge of the processes of some measured parts or variables."""
    if isinstance(problem, Stack):
        return promises.with_knowledge(problem, known)
    kinds = {v.name: v.kind for v in problem.variables}
    settings = {
        name: _variable(problem.given.variables[name], kinds[name], knowledge) for name, knowledge in known.items()
    }
    variables = dict(problem.given.variables) | settings
    return type(problem)(replace(problem.given, variables=variables))


def _variable(setting: VariableSetting, kind: Kind, known: Knowledge) -> VariableSetting:
    assert setting.sample is not None
    offset = known.mean if setting.sample.offset else 0.0
    sample = replace(setting.sample, knowledge=known, offset=offset)
    if kind is Kind.STANDARD_DEVIATION:
        return replace(setting, sample=sample, value=known.std)
    return replace(setting, sample=sample, distribution=sample.distribution)


# What is known of the processes of measured parts, as a table.


KNOWN = ("part", "parts", "unit", "mean", "std", "made_to", "df", "type", "index", "value", "low", "high", "departures")


def capability_table(problem: ToleranceProblem) -> pd.DataFrame:
    """Every measured characteristic: its indices with confidence limits, its type, departures.

    One without limits has no index: its row has none. A mean is from the mid-limit, that of a
    characteristic with one limit, which has no Cp, from the nominal.
    """
    rows: list[dict[str, Any]] = []
    for name, unit, sample in problem.samples():
        base = {
            "part": name,
            "parts": sample.parts,
            "unit": unit,
            "mean": sample.mean,
            "std": sample.knowledge.std,
            "made_to": sample.made_to or None,
            "df": sample.knowledge.df,
            "type": sample.type,
            "departures": "; ".join(finding.text for finding in sample.findings),
        }
        indices = [
            {"index": key, "value": index.value, "low": index.low, "high": index.high}
            for key, index in sample.indices.items()
        ]
        rows += [base | index for index in indices or [{}]]
    return pd.DataFrame(rows, columns=list(KNOWN))


def worth_of_corrections(problem: ToleranceProblem, front: pd.DataFrame, point: int) -> str:
    """What the least cost falls by where the cavities or machines of a part of a stack are set to one
    mean, or the one that stands out to that of the others; empty where none differ, or that lowers no cost.
    """
    if not isinstance(problem, Stack):
        return ""
    differing = {
        part.name: part.sample for part in problem.definition.parts if part.sample and part.sample.subpopulations
    }
    if not differing or front.empty or "cost" not in problem.objectives:
        return ""
    levels = {name: float(front[name].iloc[point]) for name in problem.objectives if name != "cost"}
    cheapest = cheapest_at(problem, levels)
    cost, sentences = cheapest_design(cheapest).cost, []
    for name, sample in differing.items():
        assert sample.subpopulations is not None
        changes = {f"Setting all {sample.subpopulations.plural} of {name} to one mean": sample.corrected()}
        if sample.stands_out:
            text = sample.correction_text() or f"{sample.furthest_text()}: correcting it"
            changes = {f"Of {name}, {text}": sample.corrected(one=True)} | changes
        told = 1e-6 * abs(cost)
        for text, changed in changes.items():
            worth = cost - cheapest_design(promises.with_knowledge(cheapest, {name: changed})).cost
            if worth > told:  # all groups: only where that is worth more than the one that stands out
                money = f"{worth:.3g} {problem.settings.money.currency}".strip()
                sentences.append(f"{text}{', and' if 'Cpk' in text else ''} is worth {money}.")
                told = 1.01 * worth
    return " ".join(sentences)


# The cheapest allocation that keeps a promise.


Solved: TypeAlias = tuple[Form, Optimum]
"""The form of a problem, and its least cost."""
EVALUATIONS = 600
"""Of a search among many choices of processes."""


@dataclass(frozen=True, slots=True)
class Least:
    """A full design (all variables,) and its cost; NaN where there is none."""

    cost: float
    design: Array

    @classmethod
    def none(cls, problem: ToleranceProblem) -> Least:
        """No design."""
        return cls(float("nan"), np.full(len(problem.variables), np.nan))


def cheapest_design(problem: ToleranceProblem, near: Array | None = None) -> Least:
    """The cheapest design of a problem whose only objective is the cost: exact where it can be.

    Many choices without a closed form are searched (an expected yield by sampled machines). A
    problem that is tested on units is solved from the design `near` (all variables,), at its
    integers.
    """
    if problem.declaration.sampled and near is not None:
        return _descend_from_design(problem, near)
    solver, budget = (Hybrid(), Budget(evaluations=EVALUATIONS)) if _has_many_choices(problem) else (Exact(), Budget())
    result = search(problem, solver, budget, problem.settings.seed)
    x = result.chosen if len(result.chosen) else result.x
    if not len(x):
        return Least.none(problem)
    designs = problem.complete(x)
    costs = problem.cost_of(designs)
    at = int(np.argmin(costs))
    return Least(float(costs[at]), designs[at])


def _has_many_choices(problem: ToleranceProblem) -> bool:
    """Whether a problem has more choices of processes than are enumerated, and no closed form."""
    if not isinstance(problem, Stack):
        return False
    choices = float(np.prod([len(part.processes) for part in problem.definition.parts], dtype=float))
    return choices > SETS and closed_form(problem) is None


def _descend_from_design(problem: ToleranceProblem, near: Array) -> Least:
    """By gradients from a design (all,), at its integers, tested on fresh units."""
    run = Run(problem, Budget(), problem.settings.seed)
    free = [problem.names.index(v.name) for v in problem.free]
    branch = Branch(run, np.clip(near[free], problem.xl, problem.xu), scale_of(problem))
    start = branch.smooth.scaled(near[None, free])[0]
    if branch.minimise(0, start, np.full(1, np.inf)) is None:
        return Least.none(problem)
    x = feasible_afresh(run, branch, branch.y[0], branch.f[0], search=True)
    if np.any(problem.tested(x)[1] > 0.0):
        return Least.none(problem)
    design = problem.complete(x)
    return Least(float(problem.cost_of(design)[0]), design[0])


def solved(problem: ToleranceProblem) -> Solved | None:
    """The form of a problem and its least cost with multipliers; None without a closed form."""
    form = closed_form(problem)
    if form is None:
        return None
    optimum = least_cost(form, loosened(row_limits(problem, form), 0.5)[None, :])
    return (form, optimum) if np.isfinite(optimum.cost[0]) else None


# Which limits of a problem keep its promise.


def promised_limits(problem: ToleranceProblem) -> set[str]:
    """Names of the limits that keep the promise of a problem, none where it promises nothing."""
    if problem.promise is None:
        return set()
    if isinstance(problem, Stack) and problem.promises is not None:
        output = problem.promise.output
        return {requirement.measured.name(output) for requirement in problem.promises.requirement_promises}
    return {problem.promise.output}


# What to measure next: where twenty more parts lower the cost of an assured promise most.
#
# First the shadow price: with more parts the norm of the same tolerances falls, and the multiplier of
# the promise gives the gain (envelope theorem). This ignores that the next sample will differ from
# the last one; for the first few the expected least cost over its outcomes (pre-posterior analysis,
# Raiffa & Schlaifer 1961) is computed.


FURTHER_PARTS = 20
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
        least = least or (cheapest_design(problem) if known and not problem.declaration.sampled else None)
        if least is None or not np.isfinite(least.cost):
            return pd.DataFrame()
        cost, gains = least.cost, shadow_gains(problem, least.design)
    ranked = [list(gains)[at] for at in descending(np.array(list(gains.values())))]
    rows = []
    for rank, name in enumerate(ranked, 1):
        reoptimised = rank <= first and start is not None
        expected = expected_gain(problem, name, start) if reoptimised else np.nan
        rows.append(
            {
                "rank": rank,
                "part": name,
                "parts_measured": int(known[name].n),
                "more_parts": FURTHER_PARTS,
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
    better_known = closed_form(with_knowledge(problem, {name: add_parts(known_of(problem)[name], 1.0)}))
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
        better_known = with_knowledge(problem, {name: add_parts(knowledge, 1.0)})
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
    ratios = stats.f.ppf(probabilities, FURTHER_PARTS, known.df)
    costs = []
    for ratio in ratios.tolist():
        better_known = solved(with_knowledge(problem, {name: add_parts(known, ratio)}))
        if better_known is None:
            return float("nan")
        costs.append(float(better_known[1].cost[0]))
    return float(start[1].cost[0]) - float(np.mean(costs))


def add_parts(known: Knowledge, ratio: float) -> Knowledge:
    """Knowledge with `FURTHER_PARTS` parts whose variance is `ratio` times that known before."""
    df = known.df + FURTHER_PARTS
    variance_ratio = (known.df + FURTHER_PARTS * ratio) / df
    gauge = known.difference
    if gauge is not None:
        gauge = replace(
            gauge,
            measured=gauge.gauge + variance_ratio * gauge.part_variance,
            measured_df=gauge.measured_df + FURTHER_PARTS,
        )
    return replace(
        known, std=known.std * float(np.sqrt(variance_ratio)), n=known.n + FURTHER_PARTS, df=df, difference=gauge
    )


# Whether measured parts are normal enough for a promise to be called assured.


MIN_SKEWED_PARTS = 20
"""Parts below which a skewed sample does not carry an assurance."""
NOT_NORMAL = ("shape", "outlier")
"""Findings that no normal process has: an outlier is a tail whose cause is not known."""
DRAWS = 4000
"""Draws of the Bayesian bootstrap."""


def withholding_reasons(problem: ToleranceProblem) -> list[str]:
    """Why the word "assured" is withheld, a phrase for each part; none where it is not."""
    return [f"{name} {why}" for name, _, sample in problem.samples() if (why := doubt(sample))]


def any_not_normal(stack: Stack) -> bool:
    """Whether a measured part is not normal, as far as the tests show."""
    return any(part.sample is not None and _is_not_normal(part.sample) for part in stack.definition.parts)


def bootstrap_assurance(stack: Stack, design: Array) -> float:
    """Assurance [percent] of a full design (all variables,) by the Bayesian bootstrap: the least of
    all requirements; parts without a sample are normal as stated.
    """
    t = stack.tolerances(design[None, :])[0]
    fraction = stack.definition.promise.fraction if stack.definition.promise else 0.0
    drawn = [_cumulants(stack, at) for at in range(len(stack.definition.parts))]
    assurances = []
    for requirement in stack.measured:
        mechanism = requirement.mechanism
        if not mechanism.bounded:
            continue
        cumulants = []
        for at, part_cumulants in enumerate(drawn):
            slopes = mechanism.sensitivities[mechanism.owners == at] * t[at]
            powers = np.array([np.sum(slopes**k) for k in (1, 2, 3, 4)])
            cumulants.append(part_cumulants * powers)
        ends = (mechanism.lower - mechanism.centre, mechanism.upper - mechanism.centre)
        assurances.append(fraction_within_limits(cumulants, ends, fraction))
    return 100.0 * min(assurances, default=float("nan"))


def _cumulants(stack: Stack, at: int) -> Array:
    """Drawn cumulants (draws, 4) of a part at t = 1, without what the gauge adds."""
    part = stack.definition.parts[at]
    if part.sample is None:
        m1, m2 = part.distribution.raw_moments(2)[1:]
        return np.tile([m1, m2 - m1**2, 0.0, 0.0], (DRAWS, 1))
    rng = np.random.default_rng([stack.settings.seed, at])
    sample = part.sample
    if not len(sample.deviations):  # a supplier's mean and standard deviation: normal
        variance, error = sample.knowledge.drawn(DRAWS, rng)
        std = sample.knowledge.std / sample.made_to
        return np.stack([std * error, std**2 * variance, *np.zeros((2, DRAWS))], axis=1)
    scale = sample.knowledge.std / float(np.std(sample.deviations, ddof=1)) / sample.made_to
    return draw_cumulants(sample.deviations * scale, DRAWS, rng)


def _is_not_normal(sample: PartSample) -> bool:
    return any(finding.kind in NOT_NORMAL for finding in sample.findings)


def doubt(sample: PartSample) -> str:
    """Why a sample does not carry an assurance, empty where it does."""
    from scipy import stats  # takes long to import

    if not _is_not_normal(sample):
        return ""
    if any(finding.kind == "outlier" for finding in sample.findings):
        return "has an outlier"
    values = sample.deviations
    skew, excess = float(stats.skew(values)), float(stats.kurtosis(values))
    if excess > abs(skew):
        return f"has heavy tails (excess kurtosis {excess:.2g})"
    if len(values) < MIN_SKEWED_PARTS:
        return f"is skewed ({skew:.2g}) and has {len(values)} parts only; {MIN_SKEWED_PARTS} are enough"
    return ""


# The promise of a run: in one sentence, by statement, and the part it depends on most.


STANDARD_ERRORS = 2.0
"""Standard errors by which an assurance by units may fall short of the confidence."""
COSTS = ("statement", "cost", "dearer_percent", YIELD, ASSURANCE)


@dataclass(frozen=True, slots=True)
class PromiseOutcome:
    """The entries of `summary.json`, a sentence, and the tables of the same names."""

    summary: dict[str, Any]
    sentence: str
    costs: pd.DataFrame
    next_parts: pd.DataFrame


def promise_outcome(
    problem: ToleranceProblem, front: pd.DataFrame, point: int, drawing: Array | None = None
) -> PromiseOutcome | None:
    """The promise at a point of a front; None where nothing is promised, or no point exists.

    `drawing` is the full design (all variables,) of that point as it is rounded, where it is known.
    """
    promise = problem.promise
    if promise is None or front.empty or not promised_limits(problem):
        return None
    row, design = front.iloc[point], designs_of(problem, front.iloc[[point]])[0]
    levels = {name: float(row[name]) for name in problem.objectives if name != "cost"}
    cheapest_problem = cheapest_at(problem, levels)
    least = {
        statement: _least(with_statement(cheapest_problem, statement), design, promise, levels)
        for statement in STATEMENTS
    }
    costs = costs_by_statement(cheapest_problem, least)
    ranking = next_parts(with_statement(cheapest_problem, ASSURED), least=least[ASSURED])
    summary: dict[str, Any] = promise.table() | {
        "point": point,
        ASSURANCE: _least_of(dict(row), ASSURANCE),
        "assured_withheld": withholding_reasons(problem),
        "costs": {record["statement"]: record["cost"] for record in costs.to_dict("records")},
        "hangs_on": str(ranking["part"].iloc[0]) if len(ranking) else None,
    }
    if promise.statement == ASSURED and problem.declaration.sampled:
        doubt = STANDARD_ERRORS * _least_of(dict(row), f"{ASSURANCE}_error")
        summary["kept"] = bool(summary[ASSURANCE] + doubt >= promise.confidence_percent)
    if isinstance(problem, Stack):
        summary |= _stack_assurance(problem, design)
    if drawing is not None:
        summary |= _drawing_compliance(problem, drawing)
    text = sentence(summary, promise.words(), costs, problem.settings.money.currency)
    return PromiseOutcome(summary, text, costs, ranking)


def _least(problem: ToleranceProblem, design: Array, promise: Promise, levels: Mapping[str, float]) -> Least:
    """The least cost by a statement; with one objective and the statement of the run it is that of
    the run, where the problem is tested on units or nothing is cheaper.
    """
    stated = problem.promise
    assert stated is not None
    if levels or stated.statement != promise.statement:
        return cheapest_design(problem, design)
    of_run = Least(float(problem.cost_of(design[None, :])[0]), design)
    least = of_run if problem.declaration.sampled else cheapest_design(problem, design)
    return least if least.cost <= of_run.cost else of_run


def _stack_assurance(problem: Stack, design: Array) -> dict[str, Any]:
    """The level of the norm, and the assurance by the Bayesian bootstrap."""
    entries: dict[str, Any] = {}
    if problem.promises is not None and (level := problem.promises.level) is not None:
        entries |= {
            "level_percent": 100.0 * level.confidence,
            "level_sure": level.sure,
            "without_choice_percent": 100.0 * level.without,
        }
    if any_not_normal(problem):
        entries["bootstrap_percent"] = bootstrap_assurance(problem, design)
    return entries


def _drawing_compliance(problem: ToleranceProblem, drawing: Array) -> dict[str, Any]:
    """Whether a rounded full design (all variables,) keeps the promise, and how surely."""
    designs, outputs = drawing[None, :], problem.outputs_of(drawing[None, :])
    promised = promised_limits(problem)
    kept = all(
        np.all(limit.kept(problem.values(designs, outputs, limit.name)))
        for limit in problem.limits
        if limit.name in promised
    )
    values = {name: float(value[0]) for name, value in outputs.items()}
    return {"rounded_kept": kept, f"rounded_{ASSURANCE}": _least_of(values, ASSURANCE)}


def costs_by_statement(problem: ToleranceProblem, least: Mapping[str, Least]) -> pd.DataFrame:
    """The least cost by each statement, its plug-in yield and its assurance."""
    promise, rows = problem.promise, []
    assert promise is not None
    for statement, allocation in least.items():
        assurances: dict[str, float] = dict.fromkeys((YIELD, ASSURANCE), np.nan)
        if np.isfinite(allocation.cost):
            outputs = with_statement(problem, statement).outputs_of(allocation.design[None, :])
            values = {name: float(value[0]) for name, value in outputs.items()}
            assurances = {YIELD: _least_of(values, promise.of), ASSURANCE: _least_of(values, ASSURANCE)}
        rows.append({"statement": statement, "cost": allocation.cost, **assurances})
    table = pd.DataFrame(rows)
    table["dearer_percent"] = 100.0 * (table["cost"] / table["cost"].iloc[0] - 1.0)
    return table[list(COSTS)]


def _least_of(row: Mapping[Any, Any], name: str) -> float:
    """The least of an output over all requirements."""
    values = [value for key, value in row.items() if str(key).split(".")[-1] == name]
    return min(map(float, values), default=float("nan"))


def _probability(percent: float) -> str:
    """Like 90.1 %; nothing is certain, and nothing out of the question, by the samples of parts."""
    if np.isnan(percent):
        return "that is not known"
    if percent >= 99.95:
        return "more than 99.9 %"
    return f"{percent:.1f} %" if percent >= 0.05 else "less than 0.1 %"


def sentence(summary: dict[str, Any], words: str, costs: pd.DataFrame, currency: str) -> str:
    """The promise in one sentence, and what it costs in a currency."""
    kept = float(summary[ASSURANCE])
    text = f"Promised: {words}"
    if summary["assured_withheld"] and summary["statement"] == ASSURED:
        text += f" (if all parts were normal; it is not called assured, for {'; '.join(summary['assured_withheld'])})"
    text += f"; given the uncertainty of the samples it is kept with a probability of {_probability(kept)}"
    if summary.get("kept") is False:
        text += ", less than the confidence that was asked for: it is not assured"
    if summary.get("rounded_kept") is False:
        text += (
            f"; as rounded for the drawing it is not kept (probability "
            f"{_probability(float(summary[f'rounded_{ASSURANCE}']))}): state finer steps in "
            "[rounding]"
        )
    if "bootstrap_percent" in summary:
        text += f", by the Bayesian bootstrap {float(summary['bootstrap_percent']):.1f} %"
    by = costs.set_index("statement")["cost"]
    if by.empty:
        return f"{text}."
    if np.isfinite(by.get(ASSURED, np.nan)) and np.isfinite(by.iloc[0]):
        text += (
            f". At the least cost the estimates alone would ask for {by.iloc[0]:.4g}, an expected yield for "
            f"{by.get('predictive', np.nan):.4g}, assurance for {by[ASSURED]:.4g} {currency}".rstrip()
        )
    elif not np.isfinite(by.get(ASSURED, np.nan)) and "kept" not in summary:
        text += ". There is no assured choice: even the tightest tolerances do not assure it"
    if summary["hangs_on"] and not by.get(ASSURED, np.nan) <= by.iloc[0]:  # else nothing is to be saved
        text += f". It depends most on {summary['hangs_on']}: measure more of it first"
    return f"{text}."
