"""Imports matplotlib without the documentation that it composes for every artist.

The documentation takes a quarter of the import, and nobody reads the properties of `Artist.set` in
a process that draws a figure for a report. Artists that are defined later have it.
"""

from __future__ import annotations

from matplotlib import artist

_documentation = artist.kwdoc
artist.kwdoc = lambda artist: ""
try:
    import matplotlib.axes
    import matplotlib.figure  # noqa: F401
finally:
    artist.kwdoc = _documentation
