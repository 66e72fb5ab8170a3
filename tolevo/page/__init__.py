"""Pages, figures and tables of results; nothing is computed here."""

from . import drawing
from .figures import front_figure
from .page import page

__all__ = ["drawing", "front_figure", "page"]
