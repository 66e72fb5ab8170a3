"""Q-DAS files (AQDEF)."""

from .reading import SUFFIXES, read_aqdef
from .records import Characteristic

__all__ = ["SUFFIXES", "Characteristic", "read_aqdef"]
