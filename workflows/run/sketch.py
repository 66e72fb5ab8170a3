"""The drawing of a machine with the shares of its parts, as the page shows it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...problems.interfaces import Page
from ...problems.tolerance_problem import ToleranceProblem


def drawn(problem: ToleranceProblem, front: pd.DataFrame) -> dict[str, Any]:
    """`machine`: the parts with their shares [%] at the point in the middle of the front by cost,
    its cost, and the poses. Empty where a problem has no drawing.
    """
    sketch = Page.of(problem).sketch()
    if front.empty or not sketch:
        return {}
    order = front["cost"].astype(float).argsort(kind="stable")
    row = front.iloc[int(order.iloc[len(front) // 2])]
    parts = []
    for part in sketch["parts"]:
        shares = [float(row[name]) for name in part["shares"]]
        parts.append({**part, "shares": None, "share": round(float(np.sum(shares)), 2)})
    parts = [{key: value for key, value in part.items() if value is not None} for part in parts]
    return {"machine": {"parts": parts, "poses": sketch["poses"], "cost": float(row["cost"])}}
