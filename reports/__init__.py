"""Pages, figures and tables from results; nothing is computed here."""

from .figure import front_figure
from .page import page

__all__ = ["front_figure", "page"]
