"""What is known of the processes of measured parts, as a table."""

from __future__ import annotations

from typing import Any

import pandas as pd

from ...problems.interfaces import Checks
from ...problems.tolerance_problem import ToleranceProblem

KNOWN = ("part", "parts", "unit", "mean", "std", "made_to", "df", "type", "index", "value", "low", "high", "departures")


def capability_table(problem: ToleranceProblem) -> pd.DataFrame:
    """Every measured characteristic: its indices with confidence limits, its type, departures.

    One without limits has no index: its row has none. A mean is from the mid-limit, that of a
    characteristic with one limit, which has no Cp, from the nominal.
    """
    rows: list[dict[str, Any]] = []
    for name, unit, sample in Checks.of(problem).samples():
        base = {
            "part": name,
            "parts": len(sample.deviations),
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
