"""A Q-DAS file as a table: a column per characteristic, a row per measured part."""

from __future__ import annotations

from pathlib import Path

from ...errors import Fault
from ..columns import Columns
from ..options import ReadOptions
from ..record import Dialect, Table
from ..unit_text import known_unit
from .reading import characteristics


def table_of_aqdef(
    path: Path, place: str, options: ReadOptions
) -> tuple[Table | None, list[Fault]]:
    """The values of a file, those of one row measured one after the other on one part.

    Values that are not valid are empty cells. A column is named after its characteristic, and after
    its part as well where two have the same name; `time` and `batch` are those of the first one.
    """
    found, faults = characteristics(path, place, options.encoding)
    if not found:
        return None, faults
    labels = [one.label for one in found]
    names = [
        one.label if labels.count(one.label) == 1 else f"{one.part} {one.label}" for one in found
    ]
    rows = max(len(one.values) for one in found)
    if not rows:
        faults.append(Fault(place, "holds no values"))
    columns = {name: _padded(one.values, rows) for name, one in zip(names, found, strict=True)}
    first = found[0]
    extra = {"time": [t.isoformat(" ") if t else "" for t in first.times], "batch": first.batches}
    for name, texts in extra.items():
        if any(texts) and name not in columns:
            columns[name] = [*texts, *[""] * (rows - len(texts))]
    cells = Columns(columns, range(1, rows + 1))
    units = {name: known_unit(one.unit) or "" for name, one in zip(names, found, strict=True)}
    notes = [
        f"{name}: {sum(v is None for v in one.values)} values are missing or not valid"
        for name, one in zip(names, found, strict=True)
        if None in one.values
    ]
    stated = {name: unit for name, unit in units.items() if unit}
    table = Table(
        cells,
        Dialect("aqdef", header=0),
        stated,
        tuple(notes),
        tuple(names),
        {name: name for name in columns},
    )
    return table, faults


def _padded(values: list[float | None], rows: int) -> list[object]:
    cells: list[object] = ["" if one is None else one for one in values]
    return cells + [""] * (rows - len(values))
