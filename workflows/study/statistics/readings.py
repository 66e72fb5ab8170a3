"""Whether an interpretation of a figure (a reading) holds by the tests."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ....records import Verdict
from ..records import LARGER_IS_BETTER, Hypothesis


def verdicts(readings: tuple[Hypothesis, ...], tests: pd.DataFrame) -> tuple[Verdict, ...]:
    """A verdict with its sentence for every reading whose levels were compared."""
    outcomes = []
    for reading in readings:
        row = _row(reading, tests)
        verdict, because = _verdict(reading, row)
        words = f"{reading.figure}, “{reading.says}”: {verdict}. {because}"
        outcomes.append(Verdict(reading.figure, reading.key, (reading.a, reading.b), reading.response, verdict, words))
    return tuple(outcomes)


def _row(reading: Hypothesis, tests: pd.DataFrame) -> dict[str, Any] | None:
    """The comparison of the two levels, turned so that `a` comes first."""
    of_key = tests[
        (tests["kind"] == "wilcoxon") & (tests["key"] == reading.key) & (tests["response"] == reading.response)
    ]
    for row in of_key.to_dict("records"):
        if (row["a"], row["b"]) == (reading.a, reading.b):
            return {str(name): value for name, value in row.items()}
        if (row["a"], row["b"]) == (reading.b, reading.a):
            turned = {
                "effect": -row["effect"],
                "difference": -row["difference"],
                "low": -row["high"],
                "high": -row["low"],
            }
            return {str(name): value for name, value in row.items()} | turned
    return None


def _verdict(reading: Hypothesis, row: dict[str, Any] | None) -> tuple[str, str]:
    """The verdict, and the evidence for it."""
    if row is None:
        text = f"The study has no comparison of {reading.a} with {reading.b} in {reading.response}"
        return "undecided", f"{text}."
    if row["reason"]:
        return "undecided", f"{str(row['reason']).capitalize()}."
    if pd.isna(row["difference"]):  # a run that ended early may only have had the smaller budget
        text = f"Too many runs did not reach {reading.response} within the budget of their setting"
        return "undecided", f"{text}, and what they would have needed is not known."
    evidence = _evidence(reading, row)
    if not row["significant"]:
        return "not shown", f"{evidence}: no difference is shown."
    larger = row["effect"] > 0
    better = larger == (reading.response in LARGER_IS_BETTER)
    return ("holds" if better == reading.better else "does not hold: it is the other way round", f"{evidence}.")


def _evidence(reading: Hypothesis, row: dict[str, Any]) -> str:
    """The comparison in words."""
    size = (
        f"{reading.response} at {reading.a} less that at {reading.b} is "
        f"{row['difference']:.3g}{_interval(row)} in the median"
    )
    return f"{size} (rank correlation {row['effect']:.2f}, p = {row['p_holm']:.2g} after Holm, {row['n']} seeds)"


def _interval(row: dict[str, Any]) -> str:
    if pd.isna(row["low"]) or pd.isna(row["high"]):
        return ""
    return f" [{row['low']:.3g}, {row['high']:.3g}]"
