"""The allocations to order: chosen points that round to the same values share an order."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real

import pandas as pd

from ..records import RunResult
from ..units import drawing_number

COLUMNS = {
    "variable": "tolerance",
    "meaning": "meaning",
    "notation": "on the drawing",
    "nominal": "nominal",
    "upper_deviation": "upper deviation",
    "lower_deviation": "lower deviation",
    "upper_limit": "upper limit",
    "lower_limit": "lower limit",
    "unit": "unit",
    "grade": "grade, class",
    "symbol": "symbol",
    "process": "process",
    "roughness_Ra_um": "Ra [um]",
    "cpk_wanted": "Cpk wanted",
    "inspection": "inspection",
    "unrounded": "before rounding",
    "rounded": "value",
    "drawing": "drawing",
    "characteristic": "characteristic",
}
"""Columns of an order by those of `allocation.csv`."""
SIZES = ("nominal", "upper deviation", "lower deviation", "upper limit", "lower limit", "value")
"""Columns whose numbers go on a drawing, with all their digits."""
DRAWN = (
    "tolerance",
    "on the drawing",
    "upper deviation",
    "lower deviation",
    "nominal",
    "unit",
    "grade, class",
    "symbol",
    "process",
    "Ra [um]",
    "Cpk wanted",
    "inspection",
)
"""Columns of the sheet of an order."""
ALONE = "only"
"""The rule that chooses the one point of a run."""


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """A rounded allocation: the rules that choose it, the points of the front that round to it,
    a row per tolerance, and its cost and other values (a row of `choices.csv`).
    """

    rules: tuple[str, ...]
    points: tuple[int, ...]
    table: pd.DataFrame
    outcome: dict[str, object]

    @property
    def title(self) -> str:
        """The first rule in words, and how many more."""
        first = self.rules[0].replace("_", " ")
        more = len(self.rules) - 1
        if self.rules == (ALONE,):
            return "the allocation"
        return f"{first} and {more} more rules" if more > 1 else ", ".join(self.rules).replace("_", " ")

    @property
    def note(self) -> str:
        """All rules that choose it, and the points of the front."""
        if self.rules == (ALONE,):
            return "The one allocation of this run, rounded to what can be ordered."
        rules = ", ".join(rule.replace("_", " ") for rule in self.rules)
        points = " and ".join(str(point + 1) for point in self.points)
        if len(self.points) == 1:
            return f"Chosen by: {rules} (allocation {points} of the front)."
        return f"Chosen by: {rules}; the allocations {points} of the front round to this one."

    @property
    def verdict(self) -> str:
        """Whether the rounded allocation keeps all limits; empty where it is not known."""
        broken = self.outcome.get("rounded_violated_limits")
        if self.outcome.get("rounded_feasible"):
            return "; keeps all limits"
        return f"; breaks {broken}" if _has_value(broken) else ""

    @property
    def drawn(self) -> pd.DataFrame:
        """The table with every number that goes on a drawing as it is written there."""
        texts = self.table.copy()
        for name in set(SIZES) & set(texts):
            written: list[object] = [
                drawing_number(float(value)) if isinstance(value, Real) and _has_value(value) else value
                for value in texts[name]
            ]
            texts[name] = pd.Series(written, index=texts.index, dtype=object)
        return texts

    @property
    def sheet(self) -> pd.DataFrame:
        """What a drawing needs of every tolerance, its name in words."""
        parts = self.drawn[~self.table["tolerance"].astype(str).str.endswith("_process")]
        words = parts["tolerance"].map(lambda name: str(name).removesuffix("_t").replace("_", " "))
        return parts.assign(tolerance=words)[[name for name in DRAWN if name in parts]]


def orders(result: RunResult) -> list[Order]:
    """The orders of a run, in the order of its choices."""
    allocation, choices = result.allocation, result.choices
    if allocation is None or choices is None or not {"point", "variable", "rounded"} <= set(allocation):
        return []
    merged: dict[tuple[str, ...], list[int]] = {}
    for point, rows in allocation.groupby("point", sort=False):
        merged.setdefault(tuple(map(str, rows["rounded"])), []).append(int(str(point)))
    return [_order(points, allocation, choices) for points in merged.values()]


def _order(points: list[int], allocation: pd.DataFrame, choices: pd.DataFrame) -> Order:
    tolerances = allocation[allocation["point"] == points[0]]
    kept = [name for name in COLUMNS if name in tolerances and any(map(_has_value, tolerances[name]))]
    table = tolerances[kept].rename(columns=COLUMNS).reset_index(drop=True)
    rows = choices[choices["point"].isin(points)]
    outcome = {str(k): v for k, v in rows.iloc[0].items()} if len(rows) else {}
    rules = tuple(map(str, rows["choice"])) or (f"point {points[0]}",)
    return Order(rules, tuple(points), table, outcome)


def _has_value(value: object) -> bool:
    """Whether a cell is not empty."""
    return value is not None and value is not pd.NA and value == value and value != ""


def comparison(result: RunResult, allocations: list[Order]) -> pd.DataFrame:
    """The orders side by side, with their values before and after rounding."""
    rows = []
    for at, order in enumerate(allocations, start=1):
        row: dict[str, object] = {
            "sheet": f"{at} {order.title}"[:31],
            "chosen by": ", ".join(order.rules),
            "points": ", ".join(map(str, order.points)),
        }
        for axis in result.objectives:
            row[f"{axis.name} before"] = order.outcome.get(axis.name)
            row[f"{axis.name} rounded"] = order.outcome.get(f"rounded_{axis.name}")
        row["keeps all limits"] = order.outcome.get("rounded_feasible")
        row["breaks"] = order.outcome.get("rounded_violated_limits")
        rows.append(row)
    return pd.DataFrame(rows)
