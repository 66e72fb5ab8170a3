"""Pages, figures and tables of results; nothing is computed here."""

from . import plotting  # before anything else of matplotlib
from .figure import front_figure
from .page import page

__all__ = ["front_figure", "page", "plotting"]
