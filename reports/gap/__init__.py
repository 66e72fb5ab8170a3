"""The page and figures of a gap analysis, from its result record."""

from .page import figures, gap_page

__all__ = ["figures", "gap_page"]
