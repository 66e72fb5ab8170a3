"""Result records of `tolevo reproduce`: tables of calculations, and claims with their verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator

from ...records import Axis, ClaimsTables


def _encode_array(values: NDArray[np.generic]) -> dict[str, Any]:
    """An array with its type; numbers that are not finite are text, since JSON cannot hold them."""
    plain = [str(value) if value != value or value in (inf, -inf) else value for value in values.tolist()]
    return {"type": values.dtype.str, "values": plain}


def _decode_array(stored: Any) -> NDArray[np.generic]:
    return np.asarray(stored["values"]).astype(stored["type"])


Column = Annotated[NDArray[np.generic], PlainValidator(_decode_array), PlainSerializer(_encode_array)]
"""Numbers or text (n,); a table is made of them, and pages store them."""


@dataclass(frozen=True, slots=True)
class Chart:
    """How a table is drawn: columns `y` over column `x`, as "lines", "points", "histogram" or "bars".

    Bars lie side by side for every text in `x`.
    A histogram has the lower edges of its bins in `x` and the last upper edge in a last row of
    height 0. `marks` are lines across the drawing at a value of `x`, by what they mean. `of` names what several
    columns of one unit are values of.
    """

    kind: str
    x: str
    y: tuple[str, ...]
    marks: Mapping[str, float] = field(default_factory=dict)
    of: str = ""


@dataclass(frozen=True, eq=False)
class ComputedTable:
    """A table of a calculation: one array (n,) of numbers or of text per column."""

    name: str
    meaning: str
    columns: tuple[Axis, ...]
    values: tuple[Column, ...]
    chart: Chart | None = None


@dataclass(frozen=True, slots=True)
class Document:
    """A document whose claims are recomputed: its short name, title and where it is published."""

    name: str
    title: str
    reference: str = ""


@dataclass(frozen=True, slots=True)
class ClaimsResult(ClaimsTables):
    """Claims of documents with their verdicts; `tables` are those of the calculations by the stem of their file."""

    documents: tuple[Document, ...]
    tables: Mapping[str, ComputedTable]
