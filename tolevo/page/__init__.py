"""Pages, figures and tables of results; nothing is computed here."""

from . import drawing as plotting
from .figures import front_figure
from .page import page

__all__ = ["front_figure", "page", "plotting"]
