"""The drawing of a machine with the shares of its parts, as the page shows it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...problems.interfaces import Page
from ...problems.tolerance_problem import ToleranceProblem
from .front import middle_point


def drawn(problem: ToleranceProblem, front: pd.DataFrame) -> dict[str, Any]:
    """`machine`: the parts with their shares [%] at the point in the middle of the front by cost,
    its cost, and the poses. Empty where a problem has no drawing.
    """
    sketch = Page.of(problem).sketch()
    if front.empty or not sketch:
        return {}
    row = middle_point(front)
    parts = []
    for part in sketch["parts"]:
        stated = {key: value for key, value in part.items() if key != "shares" and value is not None}
        parts.append(stated | {"share": round(float(np.sum([float(row[name]) for name in part["shares"]])), 2)})
    return {"machine": {"parts": parts, "poses": sketch["poses"], "cost": float(row["cost"])}}
