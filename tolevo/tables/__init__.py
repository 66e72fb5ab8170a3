"""Tables of the user's: read as they come, with every fault and its place; written whole or not
at all.

The index of a table is the line number in its file (the row number in a Parquet file, from 1).
"""

from .aqdef import Characteristic, names_of_characteristics, read_aqdef
from .header import ColumnUse, Fitted, Tell
from .header import discard_lines as silent
from .header import drop_unused as without_unused
from .header import fit_columns as fitted
from .reading import PARQUET, SHOWN, cell_faults, columns_of, read_table, table_of, write
from .reading import open_or_raise as opened_whole
from .reading import open_table as opened
from .reading import parse_columns as parsed
from .record import AS_DETECTED, KEYS, NO_OPTIONS, Dialect, ReadOptions, Table
from .signs import is_missing

__all__ = [
    "AS_DETECTED",
    "KEYS",
    "NO_OPTIONS",
    "PARQUET",
    "SHOWN",
    "Characteristic",
    "ColumnUse",
    "Dialect",
    "Fitted",
    "ReadOptions",
    "Table",
    "Tell",
    "cell_faults",
    "columns_of",
    "fitted",
    "is_missing",
    "names_of_characteristics",
    "opened",
    "opened_whole",
    "parsed",
    "read_aqdef",
    "read_table",
    "silent",
    "table_of",
    "without_unused",
    "write",
]
