"""What the page shows of a run in addition to its points: limits, units, laws, tolerances."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from math import isfinite
from typing import Any

import pandas as pd

from ..records import RunResult
from ..units import split_unit

CONTRIBUTED = ("point", "output", "explained", "along")
"""Columns of `contributions.csv` that are no tolerance."""
NOT_INFORMATIVE = "not informative"
NORMAL = 3.0
"""Standard deviations of a root sum of squares: what `rss` is of a stack."""


def words(name: str) -> str:
    """A column as words, without its unit."""
    stem = split_unit(name)[0]
    stem = f"tolerance of {stem.removesuffix('_t')}" if stem.endswith("_t") else stem
    return stem.replace("_", " ").replace(".", " ")


def units_of(result: RunResult) -> dict[str, str]:
    """Units by column, as far as they are known."""
    return {axis.name: axis.unit for axis in (*result.objectives, *result.variables)} | {
        str(name): split_unit(str(name))[1] for name in result.front if split_unit(str(name))[1]
    }


def informative(result: RunResult) -> bool:
    """Whether the bounds of the points are informative."""
    return NOT_INFORMATIVE not in str(result.answers.get("proof", ""))


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
    try:
        table = tomllib.loads(result.configuration).get("limits") or {}
    except tomllib.TOMLDecodeError:
        table = {}
    if not isinstance(table, Mapping):
        return []
    limits = []
    for key, bound in table.items():
        name = str(key)
        if name in kept:
            ends: dict[str, object] = dict(bound) if isinstance(bound, Mapping) else _end(name, bound)
            limits.append(
                {
                    "name": name,
                    "label": words(name),
                    "low": ends.get("min"),
                    "high": ends.get("max"),
                    "values": kept[name].tolist(),
                }
            )
    return limits


def _end(name: str, bound: object) -> dict[str, object]:
    return {"min" if name.endswith("yield_percent") else "max": bound}


def unit_columns(result: RunResult, kept: pd.DataFrame) -> list[dict[str, Any]]:
    """Yields, probabilities and distributions of the units of each point, as the model has them."""
    aims = {axis.name for axis in result.objectives}
    endings = ("yield_percent", "_probability", "_mean", "_std", "_mean_arcmin", "_std_arcmin")
    names = [
        str(n)
        for n in kept
        if str(n).endswith(endings)
        and str(n) not in aims
        and not str(n).startswith("margin_")
        and kept[n].notna().any()
    ]
    return [
        {
            "label": words(name) if not name.endswith("yield_percent") else words(name.removesuffix("_percent")),
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
    low, high = requirements[0].get("lower"), requirements[0].get("upper")
    ends = [float(end) for end in (low, high) if isinstance(end, int | float) and isfinite(end)]
    centre = requirements[0].get("centre")
    if len(ends) < 2 and not isinstance(centre, int | float):
        return None
    mean = float(centre) if isinstance(centre, int | float) else sum(ends) / 2.0
    return {
        "label": str(requirements[0].get("name") or "requirement"),
        "unit": str(requirements[0].get("unit", "")),
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
                    "high": _upper(result),
                    "mean": kept[mean].tolist(),
                    "deviation": kept[deviation].tolist(),
                }
    return None


def _upper(result: RunResult) -> float | None:
    """`[parameters] backlash_limit_arcmin`, by which the yield of a reducer is defined."""
    try:
        parameters = tomllib.loads(result.configuration).get("parameters", {})
    except tomllib.TOMLDecodeError:
        return None
    value = parameters.get("backlash_limit_arcmin") if isinstance(parameters, Mapping) else None
    return float(value) if isinstance(value, int | float) else None
