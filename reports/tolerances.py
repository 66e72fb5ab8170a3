"""The figure of a chosen allocation in comparison with the allocation of a document."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..records import RunResult
from .drawing import COLOURS, new_axes, style_axes, words

HEIGHT = 0.3
"""Height [inch] of a variable."""


def first_choice(result: RunResult) -> int | None:
    """Row of the front that the first rule chooses."""
    if result.choices is None or result.choices.empty:
        return None
    return int(result.choices["point"].iloc[0])


def bar_places(axes: Axes, labels: Sequence[str]) -> None:
    """One label per bar, from the top."""
    axes.set_yticks(range(len(labels)), labels, fontsize="small")
    axes.invert_yaxis()


def tolerances_figure(result: RunResult) -> Figure | None:
    """Every positive number of the first choice over that of the first reference; without one, as
    it is, on a logarithmic axis. None where nothing is chosen.
    """
    point = first_choice(result)
    if point is None or point >= len(result.front):
        return None
    row, reference = result.front.iloc[point], _reference(result)
    kept = [
        axis
        for axis in result.variables
        if _positive(row, axis.name) and (reference is None or _positive(reference, axis.name))
    ]
    if not kept:
        return None
    values = [float(row[axis.name]) for axis in kept]
    figure, axes = new_axes(height=1.1 + HEIGHT * len(kept))
    if reference is None:
        axes.barh(range(len(kept)), values, color=COLOURS[0], height=0.7)
        axes.set_xscale("log")
        axes.set_xlabel("value in the unit of the variable")
        bar_places(axes, [f"{words(axis.name)} [{axis.unit or '1'}]" for axis in kept])
    else:
        shares = [value / float(reference[axis.name]) for value, axis in zip(values, kept, strict=True)]
        axes.barh(range(len(kept)), shares, color=COLOURS[0], height=0.7)
        axes.axvline(1.0, color="black", linestyle="--", linewidth=1.0)
        axes.set_xlabel(
            f"{result.choices['choice'].iloc[0]} / {reference['label']}" if result.choices is not None else ""
        )
        bar_places(
            axes,
            [f"{words(axis.name)}, {value:.3g} {axis.unit}".rstrip() for value, axis in zip(values, kept, strict=True)],
        )
    style_axes(axes)
    return figure


def _reference(result: RunResult) -> Any:
    return None if result.references.empty else result.references.iloc[0]


def _positive(row: Any, name: str) -> bool:
    value = pd.to_numeric(row.get(name), errors="coerce")
    return bool(value > 0.0)
