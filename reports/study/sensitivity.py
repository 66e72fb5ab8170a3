"""How much each key matters, with intervals, and the noise."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from matplotlib.figure import Figure

from ...records import StudyResult
from ..drawing import new_figure, style_axes
from .words import short

TITLES = MappingProxyType(
    {
        "S1": "alone (S1)",
        "ST": "with all its interactions (ST)",
        "mu_star": "mean size of its effect (mu*)",
        "sigma": "spread of its effect (sigma)",
        "anova_share": "fraction of the variance of a run",
        "noise_share": "share of noise",
    }
)
FIRST, SECOND, NOISE = "#1f5fa8", "#c4501b", "#666666"
COLOURS = MappingProxyType(
    {"S1": FIRST, "ST": SECOND, "mu_star": FIRST, "sigma": SECOND, "anova_share": FIRST, "noise_share": NOISE}
)
HEIGHT = 0.3
"""Height [inch] of a row."""


def sensitivity_figure(result: StudyResult) -> Figure:
    """One panel per response; a bar that reaches 0 is not distinguishable from 0."""
    names = list(result.sensitivity["response"].unique())
    rows = result.sensitivity.groupby("response").size()
    figure = new_figure(height=1.0 + sum(0.6 + HEIGHT * int(rows[name]) for name in names))
    panels = figure.subplots(len(names), 1, squeeze=False, height_ratios=[rows[n] for n in names])
    for axes, name in zip(panels.flat, names, strict=True):
        sensitivities = result.sensitivity[result.sensitivity["response"] == name].reset_index(drop=True)
        for statistic, part in sensitivities.groupby("statistic", sort=False):
            sides = np.abs(part[["low", "high"]].to_numpy().T - part["value"].to_numpy())
            axes.errorbar(
                part["value"],
                part.index,
                xerr=sides,
                linestyle="none",
                marker="o",
                capsize=3,
                color=COLOURS[str(statistic)],
                label=TITLES[str(statistic)],
            )
        axes.set_yticks(
            range(len(sensitivities)), [short(key) or "noise" for key in sensitivities["key"]], fontsize="small"
        )
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.invert_yaxis()
        axes.set_title(name.replace("_", " "), fontsize="medium", loc="left")
        axes.legend(frameon=False, fontsize="small")
        style_axes(axes)
    return figure


def sensitivity_caption(result: StudyResult) -> str:
    """What the figure shows."""
    confidence = 100 * result.sensitivity["level"].iloc[0]
    return (
        f"Sensitivities with {confidence:.0f} % intervals, the noise of the runs taken out and "
        "shown for itself: an effect whose interval holds 0 is not distinguishable from 0."
    )
