"""The front of a run to look into: its data, thinned by a stated rule, and its place."""

from __future__ import annotations

import json
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..records import Axis, RunResult
from ..units import split_unit
from .scripts import data, own, plotly, short

MOST = 5000
"""Points on a page at most."""
ROOM = 900_000
"""Letters that the points may take: with Plotly's script a page stays below 6 MB."""
FILES = ("common.js", "detail.js", "explorer.js")
SKELETON = """<div id="explorer" class="explorer" hidden>
<p class="hint">{rule} A click on a point selects it; so do the list and the sliders below.</p>
<div id="plots"></div>
<div class="panel">
<div id="controls"></div>
<fieldset id="worth"><legend>What is it worth?</legend></fieldset>
</div>
<div id="detail"><h3 aria-live="polite"></h3><div id="allocation"></div></div>
</div>"""
WITHOUT = (
    "The front cannot be looked into here: plotly is not installed "
    "(pip install 'tolevo[report]', then tolevo report)."
)


def interactive(result: RunResult) -> bool:
    """Whether there is a front to look into, and what it takes."""
    return bool(len(result.front) and result.objectives and plotly() is not None)


def scripts() -> tuple[Any, ...]:
    """The scripts of a page with a front on it."""
    library = plotly()
    assert library is not None
    return (library, own(*FILES))


def explorer(result: RunResult) -> str:
    """The part of the page that the scripts fill."""
    content = content_of(result, MOST)
    size = len(json.dumps(short(content), separators=(",", ":")))
    if size > ROOM:
        content = content_of(result, int(len(content["rows"]) * ROOM / size))
    count, whole = len(content["rows"]), len(result.front)
    rule = f"All {whole} points." if count == whole else (
        f"{count} of {whole} points: every choice, and others evenly along the front "
        f"(at most {MOST}, and what fits into {ROOM // 1000} kB); front.csv has all."
    )  # fmt: skip
    return SKELETON.format(rule=escape(rule)) + "\n" + data(content)


def content_of(result: RunResult, most: int) -> dict[str, Any]:
    """What the scripts read, with at most `most` points beside the chosen ones."""
    names = [axis.name for axis in result.objectives]
    front = result.front.reset_index(drop=True)
    rows = thinned(front, names, _chosen_rows(result), most)
    kept = front.iloc[rows]
    variables = [axis for axis in result.variables if axis.name in front]
    return {
        "objectives": [_axis(axis) for axis in result.objectives],
        "variables": [_axis(axis) for axis in variables],
        "rows": rows.tolist(),
        "aims": [kept[name].tolist() for name in names],
        "values": [kept[axis.name].tolist() for axis in variables],
        "bound": _column(kept, "bound"),
        "gap": _column(kept, "gap_percent"),
        "references": _references(result, names, variables),
        "choices": _choices(result),
        "rounded": _rounded(result),
        "contributions": _contributions(result.contributions),
        "exact": _exact(result, names),
        "overlays": _overlays(result, names, most),
        "ideal": dict(result.summary.get("ideal") or {}),
    }


def thinned(
    front: pd.DataFrame, names: list[str], always: list[int], most: int
) -> NDArray[np.int64]:
    """Rows of at most `most` points, evenly in the order of the objectives, and those of `always`.

    In the order of the first objective.
    """
    order = front.sort_values(names, kind="stable").index.to_numpy()
    if len(order) > most:
        some = order[np.unique(np.linspace(0, len(order) - 1, most).astype(int))]
        kept = np.isin(order, some) | np.isin(order, always)
        order = order[kept]
    return np.asarray(order, dtype=np.int64)


def _axis(axis: Axis) -> dict[str, str]:
    label = split_unit(axis.name)[0].replace("_", " ")
    return {"name": axis.name, "label": label, "unit": axis.unit, "meaning": axis.meaning}


def _column(frame: pd.DataFrame, name: str) -> list[Any]:
    return frame[name].tolist() if name in frame else [None] * len(frame)


def _choices(result: RunResult) -> list[dict[str, Any]]:
    if result.choices is None:
        return []
    return [
        {"name": row["choice"], "meaning": row["meaning"], "row": row["point"]}
        for row in result.choices.to_dict("records")
    ]


def _chosen_rows(result: RunResult) -> list[int]:
    return [int(one["row"]) for one in _choices(result)]


def _rounded(result: RunResult) -> dict[str, dict[str, Any]]:
    """By row of the front what to order, by variable."""
    found: dict[str, dict[str, Any]] = {}
    if result.allocation is not None:
        for row in result.allocation.to_dict("records"):
            found.setdefault(str(row["point"]), {})[str(row["variable"])] = row["rounded"]
    return found


def _references(result: RunResult, names: list[str], variables: list[Axis]) -> list[dict[str, Any]]:
    found = result.references
    if found.empty or any(name not in found for name in names):
        return []
    return [
        {
            "label": str(row["label"]),
            "feasible": not pd.isna(row.get("feasible")) and bool(row.get("feasible")),
            "aims": [row[name] for name in names],
            "values": [row.get(axis.name) for axis in variables],
        }
        for row in found.to_dict("records")
    ]


def _contributions(found: pd.DataFrame | None) -> list[dict[str, Any]]:
    if found is None or found.empty:
        return []
    names = [name for name in found.columns if name not in ("point", "output", "explained")]
    return [
        {
            "output": output,
            "explained": own["explained"].iloc[0],
            "names": names,
            "rows": own["point"].tolist(),
            "shares": [own[name].round(1).tolist() for name in names],
        }
        for output, own in found.groupby("output", sort=False)
    ]


def _exact(result: RunResult, names: list[str]) -> list[list[float]] | None:
    found = result.exact_front
    if found is None or any(name not in found for name in names):
        return None
    return [found[name].tolist() for name in names]


def _overlays(result: RunResult, names: list[str], most: int) -> list[dict[str, Any]]:
    """Fronts of other algorithms in the order of the first objective, at most `most` points."""
    found = []
    for label, front in result.overlays.items():
        if front.empty or any(name not in front for name in names):
            continue
        own = front.reset_index(drop=True)
        kept = own.iloc[thinned(own, names, [], most)]
        aims = [kept[name].tolist() for name in names]
        found.append({"label": f"{label}, {len(front)} points", "aims": aims})
    return found
