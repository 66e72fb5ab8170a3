"""What all figures share: a canvas without global state, labels, and reproducible bytes."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO, StringIO
from typing import Any
from weakref import WeakKeyDictionary

import matplotlib as mpl
import pandas as pd
from matplotlib import artist

from ..records import Axis, Bars
from ..units import split_unit

# The documentation that matplotlib composes for every artist takes a quarter of its import, and nobody
# reads the properties of `Artist.set` in a process that draws a figure for a report. Artists that are
# defined later have it.
_documentation = artist.kwdoc
artist.kwdoc = lambda artist: ""
try:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.category import StrCategoryLocator
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator
finally:
    artist.kwdoc = _documentation

SIZE = (7.0, 4.6)
"""Width and height [inch]: a text column and a half."""
DOTS_PER_INCH = 200
COLOURS = ("#1f5fa8", "#c4501b", "#2b7a3d", "#7b3fa0", "#8a6d00", "#b0245f")
"""Colours of lines; markers and dashes show their meaning too."""
FIXED: dict[Any, Any] = {"svg.hashsalt": "tolevo", "svg.fonttype": "path"}
"""The same identifiers in every process; letters as outlines, so that no font is needed."""
COMPRESSION = {"compress_level": 3}
"""Of PNG files: a twentieth larger than at the usual 6, in half of the time."""
_AS_SVG: WeakKeyDictionary[Figure, bytes] = WeakKeyDictionary()
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


@dataclass(frozen=True, slots=True)
class Named:
    """A figure, the stem of its files, its caption, and its key of a study, if it has any."""

    name: str
    figure: Figure
    caption: str
    key: str = ""


def new_figure(height: float = SIZE[1]) -> Figure:
    """An empty figure that pyplot does not know."""
    figure = Figure(figsize=(SIZE[0], height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def new_axes(height: float = SIZE[1]) -> tuple[Figure, Axes]:
    """A `new_figure` with one panel."""
    figure = new_figure(height)
    return figure, figure.add_subplot()


def words(name: Any) -> str:
    """The name of a column as words, without its unit."""
    return split_unit(str(name))[0].replace("_", " ")


def label_with_unit(text: str, unit: str) -> str:
    """A label with its unit in brackets, where it has one."""
    return f"{text} [{unit}]" if unit else text


def axis_label(axis: Axis) -> str:
    """`backlash_arcmin` in arcmin as "backlash [arcmin]"."""
    return label_with_unit(words(axis.name), axis.unit)


def style_axes(axes: Axes, legend: bool = False) -> None:
    """A quiet frame and grid, and every text as it is: a dollar sign starts no formula.

    With `legend`, the panel gets one without a frame first.
    """
    if legend:
        axes.legend(frameon=False, fontsize="small")
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    for spine in axes.spines.values():
        spine.set_in_layout(False)  # as large as the panel, which costs as much as its labels
    # Ticks of numbers are created when they are drawn; access to their labels would create them twice.
    fixed_locators = (FixedLocator, StrCategoryLocator)
    labelled = [axis for axis in (axes.xaxis, axes.yaxis) if isinstance(axis.get_major_locator(), fixed_locators)]
    ticks = [text for axis in labelled for text in axis.get_ticklabels()]
    box = axes.get_legend()
    for text in (axes.xaxis.label, axes.yaxis.label, axes.title, *ticks, *(box.get_texts() if box else ())):
        text.set_parse_math(False)


def flags(table: pd.DataFrame, column: str) -> list[bool]:
    """A column of booleans, all false where it is missing or empty."""
    if column not in table:
        return [False] * len(table)
    return [not pd.isna(value) and bool(value) for value in table[column]]


def as_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes every time."""
    with _fixed_settings(figure):
        buffer = BytesIO()
        canvas: Any = FigureCanvasAgg(figure)
        canvas.print_png(buffer, metadata={"Software": None}, pil_kwargs=COMPRESSION)
    return buffer.getvalue()


def as_svg(figure: Figure) -> bytes:
    """The figure as SVG, the same bytes every time; drawn once, for its file and for its page."""
    if figure not in _AS_SVG:
        with _fixed_settings(figure):
            buffer = StringIO()
            canvas: Any = FigureCanvasSVG(figure)
            canvas.print_svg(buffer, metadata=NO_METADATA)
        _AS_SVG[figure] = buffer.getvalue().encode()
    return _AS_SVG[figure]


@contextmanager
def _fixed_settings(figure: Figure) -> Iterator[None]:
    """The settings with which every file of the figure is drawn; afterwards the figure has its
    canvas and its dots per inch back.

    The canvases print by themselves, because `savefig` would draw everything once more before.
    """
    with mpl.rc_context(FIXED), warnings.catch_warnings():
        # A letter that the font lacks becomes a box; the page's tables still have it.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        canvas, dots = figure.canvas, figure.dpi
        _lay_out_panels(figure)
        figure.set_dpi(DOTS_PER_INCH)
        try:
            yield
        finally:
            figure.set_canvas(canvas)
            figure.set_dpi(dots)


def _lay_out_panels(figure: Figure) -> None:
    """Place the panels, once for all kinds of files: it takes half as long as drawing them."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")


# Bar charts of a problem: which source matters how much.


HEIGHT = 0.22
"""Height [inch] of a bar with its distance from the next."""


def bars_figure(bars: Bars) -> Figure:
    """One horizontal bar per label, in the order given, from the top."""
    figure, axes = new_axes(height=1.2 + HEIGHT * len(bars.labels))
    places = range(len(bars.labels))
    axes.barh(places, bars.values, color="#1f5fa8", height=0.7)
    axes.set_yticks(places, [label.replace("_", " ") for label in bars.labels], fontsize="small")
    axes.invert_yaxis()
    axes.set_xlabel(label_with_unit(bars.title, bars.unit))
    style_axes(axes)
    return figure
