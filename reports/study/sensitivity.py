"""How much each key matters, with intervals, and the noise."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from matplotlib.figure import Figure

from ...records import StudyResult
from ..drawing import new_figure, style_axes
from .words import short

FIRST, SECOND, NOISE = "#1f5fa8", "#c4501b", "#666666"
LOOKS = MappingProxyType(
    {
        "S1": ("alone (S1)", FIRST),
        "ST": ("with all its interactions (ST)", SECOND),
        "mu_star": ("mean size of its effect (mu*)", FIRST),
        "sigma": ("spread of its effect (sigma)", SECOND),
        "anova_share": ("fraction of the variance of a run", FIRST),
        "noise_share": ("fraction of noise", NOISE),
    }
)
"""Label and colour of every statistic."""
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
            label, colour = LOOKS[str(statistic)]
            axes.errorbar(part["value"], part.index, xerr=sides, fmt="o", capsize=3, color=colour, label=label)
        labels = [short(key) or "noise" for key in sensitivities["key"]]
        axes.set_yticks(range(len(sensitivities)), labels, fontsize="small")
        axes.axvline(0.0, color="black", linewidth=0.8)
        axes.invert_yaxis()
        axes.set_title(name.replace("_", " "), fontsize="medium", loc="left")
        style_axes(axes, legend=True)
    return figure


def sensitivity_caption(result: StudyResult) -> str:
    """What the figure shows."""
    confidence = 100 * result.sensitivity["level"].iloc[0]
    return (
        f"Sensitivities with {confidence:.0f} % intervals, from which the noise of the runs is removed; it is "
        "shown separately. An effect whose interval contains 0 is not distinguishable from 0."
    )
