"""Page and figures of recomputed claims."""

from __future__ import annotations

from .figures import Named, figures
from .page import claims_page

__all__ = ["Named", "claims_page", "figures"]
