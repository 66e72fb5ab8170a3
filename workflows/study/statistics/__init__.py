"""Statistics of a study: what its settings do, beside the noise of its runs."""

from __future__ import annotations

from .analysis import analyse

__all__ = ["analyse"]
