"""Statistics of a study: the effects of its settings, and the noise of its runs."""

from __future__ import annotations

from .analysis import analyse

__all__ = ["analyse"]
