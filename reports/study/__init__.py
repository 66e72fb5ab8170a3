"""Page and figures of a study."""

from __future__ import annotations

from .figures import Named, figures
from .page import study_page

__all__ = ["Named", "figures", "study_page"]
