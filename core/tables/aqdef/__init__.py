"""Q-DAS files (AQDEF)."""

from .reading import SUFFIXES, read_aqdef
from .records import Characteristic
from .table import names_of_characteristics

__all__ = ["SUFFIXES", "Characteristic", "names_of_characteristics", "read_aqdef"]
