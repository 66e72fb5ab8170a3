"""Page and figures of recomputed claims."""

from .figures import figures
from .page import claims_page

__all__ = ["claims_page", "figures"]
