"""How before and after are told apart in every figure of a gap: by shape, not by colour alone."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes

from ...units import split_unit

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


def words(name: str, unit: str = "") -> str:
    """`torque_Nm` as "torque [Nm]"."""
    stem, found = split_unit(name)
    kind = unit or found
    text = stem.replace("_", " ")
    return f"{text} [{kind}]" if kind else text


def shade(axes: Axes, low: float, high: float, label: str | None = "located") -> None:
    """Marks the part of an axis where the gap was located: coloured and hatched."""
    axes.axvspan(low, high, facecolor=REGION, edgecolor="#8a6d00", hatch="//", alpha=0.45,
                 linewidth=0.0, zorder=0, label=label)  # fmt: skip
