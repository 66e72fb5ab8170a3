"""Tables of the user's: read as they come, with every fault and its place; written whole or not
at all.

The index of a table is the line number in its file (the row number in a Parquet file, from 1).
"""

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .aqdef import Characteristic, aqdef_text, names_of_characteristics, read_aqdef
    from .header import ColumnUse, Tell, discard_lines, drop_unused, fit_columns
    from .reading import (
        PARQUET,
        SHOWN,
        cell_faults,
        columns_of,
        open_or_raise,
        open_table,
        parse_columns,
        read_table,
        table_of,
        write,
    )
    from .record import AQDEF_SUFFIXES, AS_DETECTED, KEYS, NO_OPTIONS, ReadOptions, Specification, Table
    from .shapes import group_of
    from .signs import is_missing, number_in

__all__ = [
    "AQDEF_SUFFIXES",
    "AS_DETECTED",
    "KEYS",
    "NO_OPTIONS",
    "PARQUET",
    "SHOWN",
    "Characteristic",
    "ColumnUse",
    "ReadOptions",
    "Specification",
    "Table",
    "Tell",
    "aqdef_text",
    "cell_faults",
    "columns_of",
    "discard_lines",
    "drop_unused",
    "fit_columns",
    "group_of",
    "is_missing",
    "names_of_characteristics",
    "number_in",
    "open_or_raise",
    "open_table",
    "parse_columns",
    "read_aqdef",
    "read_table",
    "table_of",
    "write",
]

if not TYPE_CHECKING:  # a configuration that names no table needs no pandas: loaded at the first use
    _ROOMS = {
        ".aqdef": ("Characteristic", "aqdef_text", "names_of_characteristics", "read_aqdef"),
        ".header": ("ColumnUse", "Tell", "discard_lines", "drop_unused", "fit_columns"),
        ".record": ("AQDEF_SUFFIXES", "AS_DETECTED", "KEYS", "NO_OPTIONS", "ReadOptions", "Specification", "Table"),
        ".shapes": ("group_of",),
        ".signs": ("is_missing", "number_in"),
    }
    _PLACES = {name: room for room, names in _ROOMS.items() for name in names}
    __getattr__ = lazily(__name__, dict.fromkeys(__all__, ".reading") | _PLACES)
