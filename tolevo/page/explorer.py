"""The interactive front of a run: its data, thinned by a stated rule, and the part of the page."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from html import escape
from math import isfinite
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..records import Axis, RunResult, unit_of_cost
from ..units import split_unit
from .document import data, package_scripts, shown
from .figures import ALONE, orders

# The data of a run's page in addition to its points: limits, units, distributions, tolerances.


CONTRIBUTED = ("point", "output", "explained", "along")
"""Columns of `contributions.csv` that are not those of tolerances."""
LENGTHS = ("variation", "worst_case", "rss", "domain_margin")
"""Outputs of a stack in the unit of its requirement."""
NOT_INFORMATIVE = "not informative"
NORMAL = 3.0
"""Standard deviations in the root sum of squares `rss` of a stack."""


def configured(text: str) -> dict[str, Any]:
    """The tables of a stored configuration, none where it is no TOML."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}


def words(name: str) -> str:
    """The name of a column as words, without its unit; `hub_t` is the tolerance of hub."""
    stem = split_unit(name)[0]
    stem = f"tolerance of {stem.removesuffix('_t')}" if stem.endswith("_t") else stem
    return stem.replace("_", " ").replace(".", " ")


def units_of(result: RunResult) -> dict[str, str]:
    """Units by column, as far as they are known; those of a stack by its requirements."""
    mechanism = result.summary.get("mechanism")
    requirements = mechanism.get("requirements") if isinstance(mechanism, Mapping) else None
    units = {
        str(one.get("name", "")): str(one.get("unit", "")) for one in requirements or () if isinstance(one, Mapping)
    }
    alone = next(iter(units.values())) if len(set(units.values())) == 1 else ""
    lengths = {
        name: units.get(key, alone)
        for name in map(str, result.front)
        for key, _, kind in (name.rpartition("."),)
        if kind in LENGTHS
    }
    return (
        lengths
        | {axis.name: axis.unit for axis in (*result.objectives, *result.variables)}
        | {str(name): split_unit(str(name))[1] for name in result.front if split_unit(str(name))[1]}
    )


def tolerance_records(result: RunResult) -> list[dict[str, Any]]:
    """The records of every variable, with their labels; those of an older run by its columns."""
    known = {str(record["name"]): dict(record) for record in result.tolerances}
    plain = {
        "kind": "nominal",
        "free": False,
        "integer": False,
        "labels": [],
        "low": 0.0,
        "high": 0.0,
        "nominal": None,
        "mid": None,
        "um": None,
        "rule": "",
        "orderable": [],
        "grades": [],
        "process": "",
        "costs": [],
    }
    return [
        plain
        | {"unit": axis.unit, "meaning": axis.meaning}
        | known.get(axis.name, {})
        | {"name": axis.name, "label": words(axis.name).removeprefix("tolerance of ")}
        for axis in result.variables
    ]


def limits_of(result: RunResult, kept: pd.DataFrame) -> list[dict[str, Any]]:
    """The limits of the configuration with the values of the points."""
    table = configured(result.configuration).get("limits") or {}
    if not isinstance(table, Mapping):
        return []
    limits = []
    for name, bound in _flatten_limits(table).items():
        if name in kept:
            side = "min" if name.endswith("yield_percent") else "max"
            ends: Mapping[str, object] = bound if isinstance(bound, Mapping) else {side: bound}
            low, high, values = ends.get("min"), ends.get("max"), kept[name].tolist()
            limits.append({"name": name, "label": words(name), "low": low, "high": high, "values": values})
    return limits


def _flatten_limits(table: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """The limits by the full name of their output: those of a requirement are a table of their own."""
    limits: dict[str, Any] = {}
    for key, bound in table.items():
        if isinstance(bound, Mapping) and not {"min", "max"} & set(bound):
            limits |= _flatten_limits(bound, f"{above}{key}.")
        else:
            limits[f"{above}{key}"] = bound
    return limits


def unit_columns(result: RunResult, kept: pd.DataFrame) -> list[dict[str, Any]]:
    """Yields, probabilities and distributions of the units of each point, as the model computes them."""
    aims = {axis.name for axis in result.objectives}
    endings = ("yield_percent", "_probability", "_mean", "_std", "_mean_arcmin", "_std_arcmin")
    names = [
        name
        for name in map(str, kept)
        if name.endswith(endings) and name not in aims and not name.startswith("margin_") and kept[name].notna().any()
    ]
    return [
        {
            "label": words(name.removesuffix("_percent") if name.endswith("yield_percent") else name),
            "unit": "%" if name.endswith("percent") else split_unit(name)[1],
            "values": kept[name].tolist(),
        }
        for name in names
    ]


def law_of(result: RunResult, kept: pd.DataFrame) -> dict[str, Any] | None:
    """Mean and standard deviation of a requirement at each point, with its limits and yield.

    For a stack of one requirement from its root sum square; for another problem from the columns
    `..._mean_<unit>` and `..._std_<unit>` of an objective.
    """
    law = _stack_law(result, kept) or _column_law(result, kept)
    if law is not None and "yield_percent" in kept:
        law["yield"] = kept["yield_percent"].tolist()
    return law


def _stack_law(result: RunResult, kept: pd.DataFrame) -> dict[str, Any] | None:
    mechanism = result.summary.get("mechanism")
    requirements = mechanism.get("requirements") if isinstance(mechanism, Mapping) else None
    if not requirements or len(requirements) != 1 or not isinstance(requirements[0], Mapping) or "rss" not in kept:
        return None
    requirement = requirements[0]
    low, high, centre = requirement.get("lower"), requirement.get("upper"), requirement.get("centre")
    ends = [float(end) for end in (low, high) if isinstance(end, int | float) and isfinite(end)]
    if len(ends) < 2 and not isinstance(centre, int | float):
        return None
    mean = float(centre) if isinstance(centre, int | float) else sum(ends) / 2.0
    return {
        "label": str(requirement.get("name") or "requirement"),
        "unit": str(requirement.get("unit", "")),
        "low": low,
        "high": high,
        "mean": [mean] * len(kept),
        "deviation": (kept["rss"] / NORMAL).tolist(),
    }


def _column_law(result: RunResult, kept: pd.DataFrame) -> dict[str, Any] | None:
    for axis in result.objectives:
        stem, unit = split_unit(axis.name)
        for mean, deviation in (
            (f"{axis.name}_mean", f"{axis.name}_std"),
            (f"{stem}_mean_{unit}", f"{stem}_std_{unit}"),
        ):
            if mean in kept and deviation in kept:
                return {
                    "label": words(axis.name),
                    "unit": axis.unit,
                    "low": None,
                    "high": _backlash_limit(result),
                    "mean": kept[mean].tolist(),
                    "deviation": kept[deviation].tolist(),
                }
    return None


def _backlash_limit(result: RunResult) -> float | None:
    """`[parameters] backlash_limit_arcmin`, by which the yield of a reducer is defined."""
    parameters = configured(result.configuration).get("parameters")
    value = parameters.get("backlash_limit_arcmin") if isinstance(parameters, Mapping) else None
    return float(value) if isinstance(value, int | float) else None


MAX_POINTS = 5000
"""Points on a page at most."""
MAX_OTHER_POINTS = 400
"""Points of any other front on a page at most."""
MAX_CONTENT_CHARACTERS = 620_000
"""Characters of the points at most, so that a page stays below 1.5 MB."""
SHARED = 250
"""Points with contributions and prices on a page at most; others show those of the nearest."""
FILES = ("common.js", "chart.js", "parallel.js", "histogram.js", "model.js", "panel.js", "explorer.js")
SKELETON = """<section id="work" class="work" aria-label="Front and selected allocation" hidden>
<div class="left">
<form id="asks" class="asks"></form>
<div id="plots"></div>
<details id="parallel"><summary>All objectives and tolerances; drag along an axis to narrow it
</summary><div></div></details>
<p class="hint">{rule} Click or drag on the front, or use the slider, to select a point.</p>
</div>
<div class="right" id="detail">
<h2 id="headline" aria-live="polite"></h2>
<div id="slope"></div>
<div id="controls"></div>
<div id="views" role="tablist" aria-label="The selected allocation"></div>
<div id="allocation" class="scroll" role="tabpanel" tabindex="0" aria-labelledby="view-matters">
</div>
<p id="exports"></p>
<details id="units"><summary>Units at this point: histogram, yield, Cpk</summary>
<div id="units-body"></div></details>
</div>
</section>"""


def has_front(result: RunResult) -> bool:
    """Whether the run has a front to show."""
    return bool(len(result.front) and result.objectives)


def scripts() -> tuple[Any, ...]:
    """The scripts of a page with a front on it."""
    return (package_scripts(*FILES),)


def explorer(result: RunResult) -> str:
    """The part of the page that the scripts fill."""
    content = content_of(result, MAX_POINTS)
    text = data(content)
    if len(text) > MAX_CONTENT_CHARACTERS:
        content = content_of(result, max(1, int(len(content["rows"]) * MAX_CONTENT_CHARACTERS / len(text))))
        text = data(content)
    count, whole = len(content["rows"]), len(result.front)
    rule = f"All {whole} points." if whole > 1 else "The only point."
    if count != whole:
        rule = (
            f"{count} of {whole} points: every choice, and others evenly along the front "
            f"(at most {MAX_POINTS}, and as many as fit into {MAX_CONTENT_CHARACTERS // 1000} kB); front.csv has all."
        )
    return SKELETON.format(rule=escape(rule)) + "\n" + text


def content_of(result: RunResult, most: int) -> dict[str, Any]:
    """The data that the scripts read, with at most `most` points in addition to the chosen ones."""
    names = [axis.name for axis in result.objectives]
    front = result.front.reset_index(drop=True)
    rows = thin_points(front, names, [int(choice["row"]) for choice in _choices(result)], most)
    kept = front.iloc[rows]
    of_cost = kept.drop(columns=["bound", "gap_percent"], errors="ignore") if "bound_of" in result.summary else kept
    variables = [axis for axis in result.variables if axis.name in front]
    relaxed = {} if result.relaxed is None else dict(iter(result.relaxed.groupby("label", sort=False)))
    return {
        "objectives": [_axis(axis) | _unit(axis, result) for axis in result.objectives],
        "variables": [_axis(axis) for axis in variables],
        "rows": rows.tolist(),
        "aims": [kept[name].tolist() for name in names],
        "values": [kept[axis.name].tolist() for axis in variables],
        "bound": _column(of_cost, "bound"),
        "gap": _column(of_cost, "gap_percent"),
        "references": _references(result, names, variables),
        "choices": _choices(result),
        "rounded": _rounded_values(result),
        "unit": unit_of_cost(result.summary),
        "informative": NOT_INFORMATIVE not in str(result.answers.get("proof", "")),
        "tolerances": tolerance_records(result),
        "limits": limits_of(result, kept),
        "prices": _prices(result.prices),
        "units": unit_columns(result, kept),
        "law": law_of(result, kept),
        "whole": len(front),
        "changes": _changes(result),
        "changed": [
            {"label": words(name), "unit": units_of(result).get(name, "")} for name in _changed_requirements(result)
        ],
        "orders": _orders(result),
        "relaxed": _fronts_of(relaxed, names, most),
        "contributions": _contributions(result.contributions, result),
        "exact": _exact(result, names),
        "overlays": _fronts_of(result.overlays, names, most),
        "ideal": dict(result.summary.get("ideal") or {}),
    }


def thin_points(front: pd.DataFrame, names: list[str], always: list[int], most: int) -> NDArray[np.int64]:
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
    return {"name": axis.name, "label": words(axis.name), "unit": axis.unit, "meaning": axis.meaning}


def _unit(axis: Axis, result: RunResult) -> dict[str, str]:
    """The unit of the cost, which a run states once."""
    return {"unit": unit_of_cost(result.summary)} if axis.name == "cost" and not axis.unit else {}


def _column(frame: pd.DataFrame, name: str) -> list[Any]:
    return frame[name].tolist() if name in frame else [None] * len(frame)


def _choices(result: RunResult) -> list[dict[str, Any]]:
    if result.choices is None:
        return []
    return [
        {
            "name": "the allocation" if row["choice"] == ALONE else row["choice"],
            "meaning": row["meaning"],
            "row": row["point"],
            "advice": text if isinstance(text := row.get("loosen_first"), str) else "",
        }
        for row in result.choices.to_dict("records")
    ]


def _changed_requirements(result: RunResult) -> list[str]:
    """The requirements whose change by single steps is known."""
    columns = [] if result.changes is None else map(str, result.changes)
    return [name.removeprefix("change_") for name in columns if name.startswith("change_")]


def _changes(result: RunResult) -> list[dict[str, Any]]:
    """The single steps that were tried at chosen points."""
    names = _changed_requirements(result)
    records = [] if result.changes is None else result.changes.to_dict("records")
    return [
        {
            "row": row["point"],
            "variable": row["variable"],
            "to": str(row["to"]),
            "cost": row["cost_change"],
            "each": [row[f"change_{name}"] for name in names],
            "broken": text if isinstance(text := row.get("broken"), str) else "",
        }
        for row in records
    ]


def _orders(result: RunResult) -> dict[str, dict[str, Any]]:
    """What to write on the drawing, by row of the front."""
    sheets: dict[str, dict[str, Any]] = {}
    for order in orders(result):
        sheet = order.sheet
        rows = [[shown(cell) for cell in row] for row in sheet.to_numpy(dtype=object).tolist()]
        content = {"heads": list(map(str, sheet)), "rows": rows, "verdict": order.verdict}
        sheets |= {str(point): content for point in order.points}
    return sheets


def _rounded_values(result: RunResult) -> dict[str, dict[str, Any]]:
    """The rounded values to order, by row of the front and variable."""
    rounded: dict[str, dict[str, Any]] = {}
    if result.allocation is not None:
        for row in result.allocation.to_dict("records"):
            rounded.setdefault(str(row["point"]), {})[str(row["variable"])] = row["rounded"]
    return rounded


def _references(result: RunResult, names: list[str], variables: list[Axis]) -> list[dict[str, Any]]:
    references = result.references
    if references.empty or any(name not in references for name in names):
        return []
    return [
        {
            "label": str(row["label"]),
            "feasible": not pd.isna(row.get("feasible")) and bool(row.get("feasible")),
            "aims": [row[name] for name in names],
            "values": [row.get(axis.name) for axis in variables],
        }
        for row in references.to_dict("records")
    ]


def _rows_by_output(table: pd.DataFrame) -> Iterator[tuple[Any, pd.DataFrame]]:
    """At most `SHARED` rows of a table for every output, evenly."""
    for output, rows in table.groupby("output", sort=False):
        yield output, rows.iloc[np.unique(np.linspace(0, len(rows) - 1, SHARED).astype(int))]


def _contributions(contributions: pd.DataFrame | None, result: RunResult) -> list[dict[str, Any]]:
    if contributions is None or contributions.empty or "along" not in contributions:
        return []
    names = [name for name in contributions.columns if name not in CONTRIBUTED]
    units = units_of(result)
    return [
        {
            "output": output,
            "label": words(str(output)),
            "unit": units.get(str(output), ""),
            "explained": some["explained"].iloc[0],
            "names": names,
            "rows": some["point"].tolist(),
            "along": some["along"].tolist(),
            "shares": [some[name].round(3).tolist() for name in names],
        }
        for output, some in _rows_by_output(contributions)
    ]


def _prices(prices: pd.DataFrame | None) -> list[dict[str, Any]]:
    if prices is None or prices.empty or "price_of" in prices:  # not of the cost that this page is about
        return []
    columns = {"rows": "point", "price": "price", "source": "source", "tighter": "tighter"}
    columns |= {"spread": "spread_percent"} if "spread_percent" in prices else {}
    if "tighter" not in prices:  # of an earlier version, which does not tell on which side a limit lies
        return []
    return [
        {"output": output, "unit": text if isinstance(text := some["unit"].iloc[0], str) else ""}
        | {key: some[name].tolist() for key, name in columns.items()}
        for output, some in _rows_by_output(prices)
    ]


def _exact(result: RunResult, names: list[str]) -> list[list[float]] | None:
    exact = result.exact_front
    if exact is None or any(name not in exact for name in names):
        return None
    return [exact[name].tolist() for name in names]


def _fronts_of(fronts: Mapping[Any, pd.DataFrame], names: list[str], most: int) -> list[dict[str, Any]]:
    """Other fronts in the order of the first objective, at most `most` points."""
    listed = []
    for label, front in fronts.items():
        if front.empty or any(name not in front for name in names):
            continue
        points = front.reset_index(drop=True)
        kept = points.iloc[thin_points(points, names, [], min(most, MAX_OTHER_POINTS))]
        aims = [kept[name].tolist() for name in names]
        listed.append({"label": f"{label}, {len(front)} points", "aims": aims})
    return listed
