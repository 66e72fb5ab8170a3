"""Figures that are made and not rendered."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tolevo.page import drawing


class Blank:
    """The canvas of a figure that is not rendered."""

    def __init__(self, figure: Any) -> None:
        pass

    def print_svg(self, file: Any, **_: Any) -> None:
        file.write('<svg xmlns="http://www.w3.org/2000/svg"></svg>')

    def print_png(self, file: Any, **_: Any) -> None:
        file.write(b"PNG")


@contextmanager
def blanks() -> Iterator[None]:
    """Neither panels are placed nor files drawn; every figure is made as ever."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "FigureCanvasSVG", Blank)
        patch.setattr(drawing, "FigureCanvasAgg", Blank)
        patch.setattr(drawing, "_lay_out_panels", lambda figure: None)
        yield
