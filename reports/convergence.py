"""The figure of how a run converged."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from .drawing import new_figure, plain


def convergence_figure(table: pd.DataFrame) -> Figure:
    """Hypervolume (its ratio to the exact front where known) and feasible share, by evaluations."""
    figure = new_figure(height=3.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    name = _known(table)
    if not table.empty:
        upper.plot(table["evaluations"], table[name], color="#1f5fa8", linewidth=1.2)
        lower.plot(table["evaluations"], table["feasible_fraction"], color="#c4501b", linewidth=1.2)
    upper.set_ylabel(name.replace("_", " "))
    lower.set_ylabel("feasible share")
    lower.set_ylim(-0.05, 1.05)
    lower.set_xlabel("evaluations")
    for axes in (upper, lower):
        plain(axes)
    return figure


def _known(table: pd.DataFrame) -> str:
    ratio = "hypervolume_ratio"
    return ratio if ratio in table and bool(table[ratio].notna().any()) else "hypervolume"
