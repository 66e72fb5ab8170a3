"""Page and figures of a study."""

from .figures import figures
from .page import study_page

__all__ = ["figures", "study_page"]
