"""Page of several runs side by side."""

from __future__ import annotations

from .page import comparison_page

__all__ = ["comparison_page"]
