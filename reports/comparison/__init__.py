"""Page of several runs side by side."""

from .page import comparison_page

__all__ = ["comparison_page"]
