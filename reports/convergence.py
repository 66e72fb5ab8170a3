"""The figure of how a run converged."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from .drawing import new_figure, style_axes

RATIO = "hypervolume_ratio"
"""Hypervolume over that of the exact front."""


def convergence_figure(table: pd.DataFrame) -> Figure:
    """Hypervolume (its ratio to the exact front where known) and feasible fraction, by evaluations."""
    figure = new_figure(height=3.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    name = drawn_column(table)
    if not table.empty:
        upper.plot(table["evaluations"], table[name], color="#1f5fa8", linewidth=1.2)
        lower.plot(table["evaluations"], table["feasible_fraction"], color="#c4501b", linewidth=1.2)
        if name == RATIO:
            upper.axhline(1.0, color="black", linestyle="--", linewidth=1.0)
    upper.set_ylabel(name.replace("_", " "))
    lower.set_ylabel("feasible fraction")
    lower.set_ylim(-0.05, 1.05)
    lower.set_xlabel("evaluations")
    for axes in (upper, lower):
        style_axes(axes)
    return figure


def drawn_column(table: pd.DataFrame) -> str:
    """Name of the column that is drawn."""
    return RATIO if RATIO in table and bool(table[RATIO].notna().any()) else "hypervolume"
