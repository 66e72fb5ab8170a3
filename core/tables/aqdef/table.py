"""A Q-DAS file as a table: a column per characteristic, a row per measured part."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from ...errors import Fault
from ..columns import Columns
from ..options import ReadOptions
from ..record import Dialect, Table
from ..unit_text import known_unit
from .reading import characteristics
from .records import Characteristic


def table_of_aqdef(path: Path, place: str, options: ReadOptions) -> tuple[Table | None, list[Fault]]:
    """The values of a file, those of one row measured one after the other on one part.

    Values that are not valid are empty cells. A column is named after its characteristic; where two
    have the same name after its part as well, and in one part after its number, or else its
    place in the file. `time` and `batch` are those of the first characteristic; times that cannot be
    read are left out with a note.
    """
    measured, faults, of_times = characteristics(path, place, options.encoding)
    if not measured:
        return None, faults
    names = names_of_characteristics(measured)
    rows = max(len(characteristic.values) for characteristic in measured)
    if not rows:
        faults.append(Fault(place, "holds no values"))
    named = dict(zip(names, measured, strict=True))
    columns = {name: _padded(characteristic.values, rows) for name, characteristic in named.items()}
    first = measured[0]
    times = [] if of_times else [t.isoformat(" ") if t else "" for t in first.times]
    extra = {"time": times, "batch": first.batches}
    for name, texts in extra.items():
        if any(texts) and name not in columns:
            columns[name] = [*texts, *[""] * (rows - len(texts))]
    units = {name: unit for name, characteristic in named.items() if (unit := known_unit(characteristic.unit))}
    notes = tuple(f"times are not used: {fault}" for fault in of_times[:1]) + tuple(
        f"{name}: {sum(v is None for v in characteristic.values)} values are missing or not valid"
        for name, characteristic in zip(names, measured, strict=True)
        if None in characteristic.values
    )
    cells, headers = Columns(columns, range(1, rows + 1)), {name: name for name in columns}
    return Table(cells, Dialect("aqdef", header=0), units, notes, tuple(names), headers), faults


def names_of_characteristics(measured: list[Characteristic]) -> list[str]:
    """A name for each characteristic, as short as it is the only one."""
    forms = [
        (c.label, f"{c.part} {c.label}", f"{c.part} {c.label} {c.number}", f"{c.part} {c.label} #{at}")
        for at, c in enumerate(measured, start=1)
    ]
    counts = [Counter(form) for form in zip(*forms, strict=True)]
    names = [next(name for name, count in zip(form, counts, strict=True) if count[name] == 1) for form in forms]
    return names if len(set(names)) == len(names) else [form[-1] for form in forms]


def _padded(values: list[float | None], rows: int) -> list[object]:
    cells: list[object] = ["" if value is None else value for value in values]
    return cells + [""] * (rows - len(values))
