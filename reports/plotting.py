"""Imports matplotlib without the documentation that it writes for every artist meanwhile.

That takes a quarter of the import, and nobody reads the properties of `Artist.set` in a process
that draws a figure for a report. Artists that are defined later are documented as ever.
"""

from __future__ import annotations

from matplotlib import artist


def _nothing(artist: object) -> str:
    return ""


def imported() -> None:
    """Import what the figures are drawn with."""
    documented = artist.kwdoc
    artist.kwdoc = _nothing
    try:
        import matplotlib.axes
        import matplotlib.figure  # noqa: F401
    finally:
        artist.kwdoc = documented


imported()
