"""The result of a run from its directory."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from typing import Any

import pandas as pd

from ...records import Axis, Bars, RunResult
from ...units import split_unit
from ..run.choices import FORMAT, TABLES
from .stored import Stored
from .unfinished import course

SUMMARY = "summary.json"
OVERLAYS = TABLES["overlays"]
OPTIONAL = {
    field: name for field, name in TABLES.items() if field not in ("front", "references", "convergence", "overlays")
}
OBJECTS = ("versions", "ideal", "nadir", "axes", "files", "choices", "units", "assumptions_at", "answers", "mechanism")
LISTS = ("notes", "assumptions", "bars", "rounding", "validity")
KINDS: dict[str, type] = dict.fromkeys(OBJECTS, dict) | dict.fromkeys(LISTS, list) | {"title": str, "format": int}
"""Types of the entries of the summary, where the page depends on them."""
TOLERANCES = "tolerances.json"
NAMED = {"name", "unit", "kind", "low", "high", "free", "orderable", "grades", "costs"}
"""What a record of it must have."""
NEEDED = {
    "choices": ("choice", "meaning", "point"),
    "choice_sensitivity": ("choice", "same"),
    "allocation": ("point", "variable", "rounded"),
    "contributions": ("point", "output", "explained"),
    "unit_turn": ("turn_deg", "backlash_arcmin", "measured"),
    "population": ("backlash_max_arcmin", "share_within_percent", "share_percent"),
    "assumptions_cost": ("assumption", "value", "cost"),
    "requirements": ("requirement", "multiplier_cost_per_unit"),
    "drivers": ("part", "driven_by"),
    "prices": ("point", "output", "price", "source"),
    "changes": ("point", "variable", "to", "cost_change", "breaks"),
    "relaxed": ("label",),
    "promise": ("statement", "cost", "assurance_percent"),
    "next_parts": ("part", "shadow_gain"),
    "capability": ("part", "index", "value"),
}
"""Columns that the page reads of them."""


def stored_run(stored: Stored) -> RunResult | None:
    """The result as far as it is there; None where nothing of it can be shown."""
    summary = _typed(stored.record(SUMMARY), stored)
    if stored.unfinished:
        summary.setdefault("status", "unfinished")
    stored.newer(SUMMARY, summary.get("versions"), summary.get("format"), FORMAT)
    stored.edited(summary.get("files") or {})
    configuration = stored.text("config.toml") or ""
    objectives, variables = _axes(summary, configuration)
    names = [axis.name for axis in objectives]
    front = _front(stored, names)
    missing = [name for name in names if name not in front]
    if len(front) and missing:
        stored.remark("front.csv", f"has no column {', '.join(missing)}")
    objectives = tuple(axis for axis in objectives if axis.name in front or front.empty)
    references = stored.table("references.csv", [axis.name for axis in objectives])
    convergence = _convergence(stored)
    if front.empty and _nothing(references) and _nothing(convergence):
        return None
    return RunResult(
        title=str(summary.get("title") or stored.folder.resolve().name),
        front=front,
        references=_with(references, ("label", "feasible", "violated_limits"), "references.csv", stored),
        convergence=_with(convergence, ("evaluations", "hypervolume", "feasible_fraction"), "convergence.csv", stored),
        summary=summary,
        objectives=objectives,
        variables=tuple(axis for axis in variables if axis.name in front),
        notes=tuple(map(str, summary.get("notes") or ())),
        bars=_bars(summary),
        configuration=configuration,
        tolerances=_tolerances(stored),
        overlays=_overlays(stored, [axis.name for axis in objectives]),
        **_optional(stored, len(front)),
    )


def _tolerances(stored: Stored) -> tuple[Mapping[str, Any], ...]:
    """The records of `tolerances.json`, none where it is missing or not what a run writes."""
    if not (stored.folder / TOLERANCES).is_file():
        return ()
    try:
        records = json.loads(stored.text(TOLERANCES) or "")
    except ValueError:
        records = None
    if isinstance(records, list) and all(isinstance(record, dict) and record.keys() >= NAMED for record in records):
        return tuple(records)
    stored.remark(TOLERANCES, "is not what a run writes: was it edited by hand?")
    return ()


def _convergence(stored: Stored) -> pd.DataFrame | None:
    """`convergence.csv`; of an unfinished run what its search has saved."""
    if stored.unfinished and not (stored.folder / "convergence.csv").is_file():
        return course(stored.folder)
    return stored.table("convergence.csv", ("evaluations", "hypervolume"))


def _nothing(table: pd.DataFrame | None) -> bool:
    return table is None or table.empty


def _with(table: pd.DataFrame | None, needed: tuple[str, ...], name: str, stored: Stored) -> pd.DataFrame:
    """The table, empty where there is none or a column is missing that the page reads."""
    return pd.DataFrame() if table is None or _lacks(table, needed, name, stored) else table


def _lacks(table: pd.DataFrame, needed: tuple[str, ...], name: str, stored: Stored) -> bool:
    """Whether a table lacks a column that the page reads, which is remarked."""
    missing = [column for column in needed if column not in table]
    if missing:
        stored.remark(name, f"has no column {', '.join(missing)}; left out")
    return bool(missing)


def _front(stored: Stored, names: list[str]) -> pd.DataFrame:
    """`front.csv`, or where it cannot be read `front.parquet`."""
    front = stored.table("front.csv", names)
    path = stored.folder / "front.parquet"
    if front is None and path.is_file():
        try:
            table = pd.read_parquet(path)
        except (OSError, ValueError) as error:
            stored.remark(path.name, f"is not a Parquet file ({error})")
        else:
            stored.remark(path.name, "is shown in place of front.csv")
            return stored.numbered(table, path.name, names)
    return pd.DataFrame() if front is None else front


def _overlays(stored: Stored, names: list[str]) -> dict[str, pd.DataFrame]:
    """Fronts of other algorithms by label."""
    overlays = _with(stored.table(OVERLAYS, names, needed=False), ("label", *names), OVERLAYS, stored)
    if overlays.empty:
        return {}
    groups = overlays.groupby(overlays["label"].astype(str), sort=False)
    return {str(label): front.drop(columns="label").reset_index(drop=True) for label, front in groups}


def _optional(stored: Stored, points: int) -> dict[str, pd.DataFrame | None]:
    tables: dict[str, pd.DataFrame | None] = {}
    for field, name in OPTIONAL.items():
        table = stored.table(name, needed=False)
        if table is not None and _lacks(table, NEEDED.get(field, ()), name, stored):
            table = None
        if table is not None and "point" in table:
            rows = pd.to_numeric(table["point"], errors="coerce")
            inside = rows.between(0, points - 1)
            if not inside.all():
                stored.remark(name, f"names points that front.csv does not have ({points} rows): these are left out")
            table = table[inside].assign(point=rows[inside].astype("int64"))
        tables[field] = table
    return tables


def _typed(summary: dict[str, Any], stored: Stored) -> dict[str, Any]:
    """The summary without values of a type that a run does not write."""
    for name, kind in KINDS.items():
        if name in summary and not isinstance(summary[name], kind):
            stored.remark(SUMMARY, f"{name} is not what a run writes: was it edited by hand?")
    return {name: value for name, value in summary.items() if isinstance(value, KINDS.get(name, object))}


def _axes(summary: Mapping[str, Any], configuration: str) -> tuple[tuple[Axis, ...], tuple[Axis, ...]]:
    """Objectives and variables; of an older run the objectives by its configuration."""
    axes = summary.get("axes") or {}
    named_axes = [
        tuple(
            Axis(str(axis["name"]), str(axis.get("unit", "")), str(axis.get("meaning", "")))
            for axis in (axes.get(kind) or ())
            if isinstance(axis, dict) and "name" in axis
        )
        for kind in ("objectives", "variables")
    ]
    return named_axes[0] or _by_configuration(configuration), named_axes[1]


def _by_configuration(configuration: str) -> tuple[Axis, ...]:
    try:
        names = tomllib.loads(configuration)["objectives"]["minimise"]
    except (tomllib.TOMLDecodeError, KeyError, TypeError):
        return ()
    return tuple(Axis(str(name), split_unit(str(name))[1]) for name in names)


def _bars(summary: Mapping[str, Any]) -> tuple[Bars, ...]:
    """Charts of the problem; those that are not whole are left out."""
    charts = []
    for chart in summary.get("bars") or ():
        whole = isinstance(chart, dict) and {"title", "unit", "labels", "values"} <= chart.keys()
        if whole and len(chart["labels"]) == len(chart["values"]):
            charts.append(Bars(chart["title"], chart["unit"], tuple(chart["labels"]), tuple(chart["values"])))
    return tuple(charts)
