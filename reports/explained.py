"""The data of a run's page in addition to its points: limits, units, distributions, tolerances."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from math import isfinite
from typing import Any

import pandas as pd

from ..records import RunResult
from ..units import split_unit

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
    table = configured(result.configuration).get("limits") or {}
    if not isinstance(table, Mapping):
        return []
    limits = []
    for name, bound in _flat(table).items():
        if name in kept:
            side = "min" if name.endswith("yield_percent") else "max"
            ends: Mapping[str, object] = bound if isinstance(bound, Mapping) else {side: bound}
            low, high, values = ends.get("min"), ends.get("max"), kept[name].tolist()
            limits.append({"name": name, "label": words(name), "low": low, "high": high, "values": values})
    return limits


def _flat(table: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """The limits by the full name of their output: those of a requirement are a table of their own."""
    limits: dict[str, Any] = {}
    for key, bound in table.items():
        if isinstance(bound, Mapping) and not {"min", "max"} & set(bound):
            limits |= _flat(bound, f"{above}{key}.")
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
                    "high": _upper(result),
                    "mean": kept[mean].tolist(),
                    "deviation": kept[deviation].tolist(),
                }
    return None


def _upper(result: RunResult) -> float | None:
    """`[parameters] backlash_limit_arcmin`, by which the yield of a reducer is defined."""
    parameters = configured(result.configuration).get("parameters")
    value = parameters.get("backlash_limit_arcmin") if isinstance(parameters, Mapping) else None
    return float(value) if isinstance(value, int | float) else None
