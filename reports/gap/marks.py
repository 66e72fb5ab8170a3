"""The marks of the states before and after in all figures of a gap: their shapes differ too."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...units import split_unit
from .. import drawing

REGION = "#f3d9a4"


@dataclass(frozen=True, slots=True)
class Mark:
    """The look of one state of the model."""

    word: str
    colour: str
    marker: str
    line: str
    face: str


BEFORE = Mark("before", "#c4501b", "o", "--", "none")
AFTER = Mark("after", "#1f5fa8", "x", "-", "#1f5fa8")
TAKEN = Mark("taken away", "#2b7a3d", "+", "-.", "#2b7a3d")
"""What the correction does: before less after."""


def words(name: str, unit: str) -> str:
    """`torque_Nm` as "torque [Nm]", with the unit of the name where no other is given."""
    return drawing.with_unit(drawing.words(name), unit or split_unit(name)[1])


def shade(axes: Axes, low: float, high: float, label: str = "located here") -> None:
    """Mark the part of an axis where the gap was located: coloured and hatched."""
    axes.axvspan(
        low, high, facecolor=REGION, edgecolor="#8a6d00", hatch="//", alpha=0.45, linewidth=0.0, zorder=0, label=label
    )


def legend(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend below all panels, before and after first."""
    handles: dict[str, Artist] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    states = [mark.word for mark in (BEFORE, AFTER, TAKEN)]
    labels = sorted(handles, key=lambda label: (label not in states, states.index(label) if label in states else 0))
    figure.legend(
        [handles[label] for label in labels],
        labels,
        loc="outside lower center",
        frameon=False,
        fontsize="small",
        ncols=min(len(handles), 3),
    )
