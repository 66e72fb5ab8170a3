"""The question, results and proof of a run, in sentences with numbers and conditions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...algorithms.exact.bounds import Proof
from ...problems.interfaces import Documented
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult, unit_of_cost
from ...units import split_unit
from ..promise.limits import promised_limits
from .choices import chosen_point
from .proofs import EXACT, distance_words, informative, percent
from .references import gain_column

COST = "cost"
ALIKE = 1e-9
"""Relative difference below which two values count as equal."""
TENTH = 0.1
"""Fraction of a limit by which it is loosened, to state its price."""
NEAR = 1e-3
"""Fraction of a limit within which a point counts as being at it."""


def answers(result: RunResult, problem: ToleranceProblem, proven: Proof) -> dict[str, str]:
    """`asked`, `found`, `published`, `limits` and `proof`: a sentence or two each.

    `proven` are the bounds of the front. Only `asked` where the front is
    empty.
    """
    sentences = Sentences(result, problem)
    asked = {"asked": sentences.request()}
    if result.front.empty:
        return asked
    return asked | {
        "found": sentences.outcome(),
        "published": sentences.published(),
        "limits": sentences.of_limits(),
        "proof": sentences.proof(proven),
    }


class Sentences:
    """The sentences of one run."""

    def __init__(self, result: RunResult, problem: ToleranceProblem) -> None:
        self.result, self.problem = result, problem
        self.units = {o.name: o.unit for o in problem.outputs}
        self.units |= {v.name: v.unit for v in problem.variables}
        self.units[COST] = unit_of_cost(result.summary)
        self.names = list(problem.objectives)
        self.point = chosen_point(result)

    def value(self, name: str, value: float) -> str:
        """Like "backlash 1.04 arcmin"."""
        return f"{words(name)} {value:.4g} {self.units.get(name, '')}".rstrip()

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
        more = f" and {others} other variables" if others else ""
        return f"{goal}{conditions}; {tolerances} tolerances searched{more}."

    def limit(self, limit: Limit) -> str:
        unit = f" {limit.unit}".rstrip()
        ends = [f"at least {limit.low:.4g}{unit}"] if np.isfinite(limit.low) else []
        ends += [f"at most {limit.high:.4g}{unit}"] if np.isfinite(limit.high) else []
        return f"{words(limit.name)} {' and '.join(ends)}"

    def outcome(self) -> str:
        front = self.result.front
        row = front.iloc[self.point]
        if len(front) == 1:
            limited = [o.name for o in self.problem.limits if o.name in front and o.name not in self.names]
            more = f" (with {self.row(row, limited)})" if limited else ""
            return f"Found: {self.row(row)}{more}."
        ends = ", ".join(
            f"{words(n)} {front[n].min():.4g} to {front[n].max():.4g} {self.units.get(n, '')}".rstrip()
            for n in self.names
        )
        choices = self.result.choices
        rule = "" if choices is None or choices.empty else str(choices["choice"].iloc[0])
        return f"Found: {len(front)} allocations, {ends}; the {words(rule)} has {self.row(row)}."

    def published(self) -> str:
        printed = [str(label) for label in Documented.of(self.problem).references()]
        for row in self.result.references.to_dict("records"):
            if row["label"] in printed:
                return self._comparison({str(name): value for name, value in row.items()})
        return "No published allocation of this problem is known, so nothing can be compared."

    def _comparison(self, row: dict[str, Any]) -> str:
        label, broken = str(row["label"]), str(row["violated_limits"]).split()
        published = f"The published allocation ({label}) has {self.row(row)}"
        if broken:
            values = ", ".join(
                f"{self.value(n, float(row[n]))} instead of {self.limit(self._limit(n)).removeprefix(words(n)).strip()}"
                for n in broken
            )
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
        parts = []
        for name in self.names:
            value = float(row.get(prefix + gain_column(name), np.nan))
            if np.isfinite(value):
                side = "less" if value >= 0.0 else "more"
                if self.names == [COST]:
                    side = "lower" if value >= 0.0 else "higher"
                    return f"the least cost that was found is {distance_words(abs(value))} {side}"
                others = " and ".join(words(n) for n in self.names if n != COST)
                at = f"equal {others}" if name == COST else "the same cost"
                subject = "an allocation that costs" if name == COST else f"a {words(name)} that is"
                parts.append(f"{subject} {distance_words(abs(value))} {side} at {at}")
        return "there is " + ", or ".join(parts) if parts else ""

    def of_limits(self) -> str:
        limits = [o for o in self.problem.limits if o.count and o.name != COST]
        if not limits:
            return "No limits are set in addition to the objectives, so none adds to the cost."
        row = self.result.front.iloc[self.point]
        held = [o for o in limits if self._used(o, row)]
        where = "At the one point" if len(self.result.front) == 1 else "At this point"
        if not held:
            return f"{where} every limit is kept with a margin, so none adds to the cost there."
        return " ".join(self._cost_of(limit, where) for limit in held)

    def _used(self, limit: Limit, row: pd.Series) -> bool:
        scale = max(abs(b) for b in (limit.low, limit.high) if np.isfinite(b)) or limit.scale
        return float(row[f"margin_{limit.name}"]) <= NEAR * scale

    def _cost_of(self, limit: Limit, where: str) -> str:
        text = self.limit(limit)
        priced = self._price(limit.name)
        if priced is not None:
            price, proven = priced
            how = "by the multiplier of the proven optimum" if proven else "estimated by the conditions of an optimum"
            step = _step(limit)
            unit = f" {limit.unit}".rstrip()
            cost = f" {self.units[COST]}".rstrip()
            return (
                f"{where} the limit of {text} binds: loosening it by {step:.3g}{unit} would "
                f"save about {price * step:.3g}{cost} ({how})."
            )
        relaxed = self._relaxed(limit.name)
        return relaxed or (
            f"{where} the limit of {text} binds; its price is not known, because the model gives no derivative of it."
        )

    def _price(self, name: str) -> tuple[float, bool] | None:
        prices = self.result.prices
        if prices is None:
            return None
        priced = prices[(prices["output"] == name) & np.isfinite(prices["price"])]
        if priced.empty or priced["price"].max() <= 0.0:
            return None
        row = priced.iloc[int((priced["point"] - self.point).abs().to_numpy().argmin())]
        return float(row["price"]), row["source"] == "multiplier"

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
                good &= front[n].to_numpy(dtype=float) <= float(row[n]) + ALIKE * abs(float(row[n]))
            if np.any(good):
                saved = float(row[COST]) - float(front.loc[good, COST].min())
                text = self.limit(self._limit(name))
                saved_percent = 100.0 * saved / float(row[COST])
                loose = self.value(name, float(reference[name][label]))
                return (
                    f"The limit of {text} costs {saved:.3g} ({saved_percent:.3g} %) here against "
                    f"one as loose as that of {label} ({loose})."
                )
        return ""

    def proof(self, proven: Proof) -> str:
        gap = self.result.front["gap_percent"].to_numpy(dtype=float)
        if np.all(np.isnan(gap)):
            why = proven.missing or proven.statement or "there is no bound of the cost"
            return f"How far the points are from the optimum is not proven ({why})."
        if not informative(proven, gap):
            return (
                "How far the points are from the optimum is not known: the proven bound is not informative, because it "
                f"leaves out limits that hold them back ({proven.statement})."
            )
        middle, most = float(np.nanmedian(gap)), float(np.nanmax(gap))
        if len(gap) == 1 and most < EXACT:
            return f"Proven: this is the least cost within the limits ({proven.statement})."
        if len(gap) == 1:
            return (
                f"Proven: no allocation within the limits costs less than {percent(most)} "
                f"below this one ({proven.statement})."
            )
        if most < EXACT:
            return f"Proven: every point of the front is optimal ({proven.statement})."
        return (
            f"Proven: no allocation of equal other objectives costs less than {percent(middle)} below a point of the "
            f"front in the median, {percent(most)} at most ({proven.statement})."
        )


def _step(limit: Limit) -> float:
    """A tenth of a limit; for a lower limit in percent at most a tenth of its distance to 100 %."""
    if np.isfinite(limit.high):
        return abs(limit.high) * TENTH or 1.0
    remaining = 100.0 - limit.low if limit.unit == "percent" else np.inf
    return min(abs(limit.low), remaining if remaining > 0.0 else np.inf) * TENTH or 1.0


def words(name: str) -> str:
    """A column as words, without its unit."""
    return split_unit(name)[0].replace("_", " ").replace(".", " ")
