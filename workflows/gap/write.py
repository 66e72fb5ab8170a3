"""The files of a gap analysis. Each appears whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from ...csv_text import csv_text
from ...files import write_bytes, write_text
from ...gap_records import FoundEffect, GapResult, Region, Rival
from ...reports.drawing import as_png, as_svg
from ...reports.gap.page import drawings, gap_page
from .. import page_data
from ..as_json import as_json

SUMMARY = "summary.txt"
POINTS = "next_measurement.csv"


def write(result: GapResult, folder: Path, lines: Sequence[str]) -> None:
    """Everything that the contract lists, and the summary's lines; `gap.json` last."""
    write_text(folder / "config.toml", result.configuration)
    write_text(folder / "corrected.toml", result.corrected)
    write_bytes(folder / "residuals.parquet", result.residuals.to_parquet(index=False))
    if result.next_points is not None:
        write_text(folder / POINTS, csv_text(result.next_points))
    drawn = drawings(result)
    for name, figure, _ in drawn:
        write_bytes(folder / f"{name}.png", as_png(figure))
        write_bytes(folder / f"{name}.svg", as_svg(figure))
    write_text(folder / "report.html", gap_page(result, drawn))
    write_text(folder / SUMMARY, "".join(f"{line}\n" for line in lines))
    write_text(folder / page_data.NAME, page_data.dumped(result))
    write_text(folder / "gap.json", as_json(record(result)))


def summary_of(folder: Path) -> tuple[str, ...]:
    """The summary of an analysis that has ended; empty where its file was removed."""
    path = folder / SUMMARY
    return tuple(path.read_text(encoding="utf-8").splitlines()) if path.is_file() else ()


def record(result: GapResult) -> dict[str, Any]:
    """The content of `gap.json`."""
    return {
        **({"simulated": asdict(result.drawing)} if result.drawing else {}),
        "verdict": result.verdict,
        "effects": [_effect(effect) for effect in result.effects],
        "alternatives": [_rival(rival) for rival in result.rivals],
        "next_measurement": asdict(planned) if (planned := result.next_measurement) else None,
        "unresolved": [asdict(term) for term in result.unresolved],
        "remainder": [asdict(remainder) for remainder in result.remainder],
        "unnamed": [asdict(shape) for shape in result.shapes],
        "where": [_region(region) for region in result.where],
        "population": [asdict(line) for line in result.population],
        "attribution": [asdict(attribution) for attribution in result.attribution],
        "noise_floor": _numbers(result.noise_floor),
        "gap_before": _numbers(result.gap_before),
        "gap_after": _numbers(result.gap_after),
        "gate": asdict(result.gate),
        "scores": [asdict(score) for score in result.scores],
        "steps": [asdict(step) for step in result.steps],
        **result.summary,
        "notes": list(result.notes),
    }


def _numbers(by_output: Mapping[str, float]) -> float | dict[str, float]:
    """A number for a single output; for several one by output, and the total in noise units."""
    first, *others = (size for name, size in by_output.items() if name != "total")
    return dict(by_output) if others else first


def _region(region: Region) -> dict[str, Any]:
    ends = [region.low, region.high] if isfinite(region.low) and isfinite(region.high) else None
    return {**asdict(region), "region": ends, "text": str(region)}


def _effect(effect: FoundEffect) -> dict[str, Any]:
    return {
        "name": effect.name,
        "family": effect.family,
        "cause": effect.cause,
        "parameters": {
            p.name: {"value": p.value, "interval": [p.low, p.high], "unit": p.unit, "meaning": p.meaning}
            for p in effect.parameters
        },
        "in_problem": effect.in_problem,
        "counterpart": effect.counterpart,
        "evidence": {
            "gain": effect.gain,
            "threshold": effect.threshold,
            "held_out_gain": effect.held_out_gain,
            "held_out_error": effect.held_out_error,
            "share": effect.share,
            "bootstrap_frequency": effect.frequency,
            "at_bound": list(effect.at_bound),
        },
    }


def _rival(rival: Rival) -> dict[str, Any]:
    return {
        "names": list(rival.names),
        "instead_of": list(rival.instead_of),
        "distance": rival.distance,
        "correlation": rival.correlation,
        "separating_measurement": asdict(rival.measurement),
    }
