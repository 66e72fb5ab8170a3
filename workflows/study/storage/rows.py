"""A run as a row of the database, with a checksum, and back."""

from __future__ import annotations

import struct
import zlib
from math import isnan, nan
from typing import Any

import numpy as np

from ....algorithms.course import CURVE
from ..records import RESPONSES
from ..trial import RunRecord

COLUMNS = ("point", "replicate", "seed", "status", "reason", "evaluations", "cpu_s", *RESPONSES, "curve")
"""Columns of a run in addition to its number and its checksum."""
Row = tuple[Any, ...]


def row_of(number: int, run: RunRecord, wanted: tuple[str, ...]) -> Row:
    """The row of a run: number, `COLUMNS`, checksum. What is not a number is NULL."""
    values = [_null(run.responses[name]) if name in wanted else None for name in RESPONSES]
    curve = zlib.compress(np.ascontiguousarray(run.curve, dtype="<f8").tobytes(), 1)
    reason = run.reason.encode("utf-8", "replace").decode().replace("\0", "\ufffd")
    identity = (number, run.point, run.replicate, run.seed, run.status, reason)
    row = (*identity, run.evaluations, _null(run.cpu_s), *values, curve)
    return (*row, checksum(row))


def is_intact(row: Row) -> bool:
    """Whether a row is as it was written."""
    try:
        return len(row) == len(COLUMNS) + 2 and bool(row[-1] == checksum(row[:-1]))
    except (TypeError, ValueError, struct.error):
        return False


def record_of(row: Row) -> RunRecord:
    """The run of a row that is intact."""
    _, point, replicate, seed, status, reason, evaluations, cpu_s, *values, compressed, _ = row
    responses = {name: _number(value) for name, value in zip(RESPONSES, values, strict=True)}
    curve = np.frombuffer(zlib.decompress(compressed), dtype="<f8").reshape(-1, len(CURVE))
    return RunRecord(point, replicate, seed, status, reason, evaluations, _number(cpu_s), responses, curve)


def checksum(row: Row) -> int:
    """CRC-32 of the values of a row, exact to the bit."""
    total = 0
    for value in row:
        if isinstance(value, float):
            part = b"f" + struct.pack("<d", value)
        elif isinstance(value, int):
            part = b"i" + str(value).encode()
        elif isinstance(value, str):
            part = b"s" + value.encode()
        else:
            part = b"n" if value is None else b"b" + bytes(value)
        total = zlib.crc32(part + b"\0", total)
    return total


def _null(value: float) -> float | None:
    return None if isnan(value) else float(value)


def _number(value: float | None) -> float:
    return nan if value is None else float(value)
