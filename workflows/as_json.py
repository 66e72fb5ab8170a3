"""Results as JSON text."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pandas as pd


def as_json(value: Any) -> str:
    """JSON text; what is not a finite number is null."""
    return json.dumps(_json_value(value), indent=1, allow_nan=False) + "\n"


def records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a frame by the names of its columns."""
    return [{str(name): value for name, value in row.items()} for row in frame.to_dict("records")]


def _json_value(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if isinstance(value, np.generic):
        return _json_value(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
