"""The page and figures of a gap analysis, from its result record."""

from .page import drawings, figures, gap_page

__all__ = ["drawings", "figures", "gap_page"]
