"""Whether an interpretation of a figure holds by the tests."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ....records import Verdict
from ...as_json import records
from ..records import LARGER_IS_BETTER, Hypothesis


def verdicts(hypotheses: tuple[Hypothesis, ...], tests: pd.DataFrame) -> tuple[Verdict, ...]:
    """A verdict with its sentence for every hypothesis whose levels were compared."""
    outcomes = []
    for hypothesis in hypotheses:
        verdict, because = _verdict(hypothesis, _row(hypothesis, tests))
        words = f"{hypothesis.figure}, “{hypothesis.says}”: {verdict}. {because}"
        outcomes.append(
            Verdict(
                hypothesis.figure, hypothesis.key, (hypothesis.a, hypothesis.b), hypothesis.response, verdict, words
            )
        )
    return tuple(outcomes)


def _row(hypothesis: Hypothesis, tests: pd.DataFrame) -> dict[str, Any] | None:
    """The comparison of the two levels, turned so that `a` comes first."""
    of_key = tests[
        (tests["kind"] == "wilcoxon") & (tests["key"] == hypothesis.key) & (tests["response"] == hypothesis.response)
    ]
    for row in records(of_key):
        if (row["a"], row["b"]) == (hypothesis.a, hypothesis.b):
            return row
        if (row["a"], row["b"]) == (hypothesis.b, hypothesis.a):
            turned = {
                "effect": -row["effect"],
                "difference": -row["difference"],
                "low": -row["high"],
                "high": -row["low"],
            }
            return row | turned
    return None


def _verdict(hypothesis: Hypothesis, row: dict[str, Any] | None) -> tuple[str, str]:
    if row is None:
        text = f"The study has no comparison of {hypothesis.a} with {hypothesis.b} in {hypothesis.response}"
        return "undecided", f"{text}."
    if row["reason"]:
        return "undecided", f"{str(row['reason']).capitalize()}."
    if pd.isna(row["difference"]):  # a run that ended early may only have had the smaller budget
        text = f"Too many runs did not reach {hypothesis.response} within the budget of their setting"
        return "undecided", f"{text}, and what they would have needed is not known."
    evidence = _evidence(hypothesis, row)
    if not row["significant"]:
        return "not shown", f"{evidence}: no difference is shown."
    better = (row["effect"] > 0) == (hypothesis.response in LARGER_IS_BETTER)
    return ("holds" if better == hypothesis.better else "does not hold: it is the other way round", f"{evidence}.")


def _evidence(hypothesis: Hypothesis, row: dict[str, Any]) -> str:
    size = (
        f"{hypothesis.response} at {hypothesis.a} less that at {hypothesis.b} is "
        f"{row['difference']:.3g}{_interval(row)} in the median"
    )
    return f"{size} (rank correlation {row['effect']:.2f}, p = {row['p_holm']:.2g} after Holm, {row['n']} seeds)"


def _interval(row: dict[str, Any]) -> str:
    if pd.isna(row["low"]) or pd.isna(row["high"]):
        return ""
    return f" [{row['low']:.3g}, {row['high']:.3g}]"
