"""Operating points too many to be held at once: Parquet files that are read batch by batch."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from .. import tables
from ..errors import Fault, raise_all, refuse
from .blocks import ParquetRows
from .blocks.rows import batches, digest_of
from .simulate import Simulation, remarks, typed_inputs, units_of

LONG = 1_000_000
"""Rows from which on a file is read in batches."""
FAULTS = 50
"""Faults after which a long table is not checked further."""


def streamed(
    simulation: Simulation,
    path: Path,
    uses: Mapping[str, tables.ColumnUse] | None = None,
    understood: tables.Tell = tables.silent,
    notes: tables.Tell = tables.silent,
) -> ParquetRows | None:
    """The rows of a long Parquet file, or of a directory of such files; None for other tables.

    Every row is checked before any is computed. A file with columns that must be converted, or for
    effects, is read as a whole (None); of a directory that is refused. Raises InputError with the
    faults.
    """
    files = _files(path)
    if not files:
        return None
    obstacle = _obstacle(simulation, files, uses)
    if obstacle and path.is_dir():
        raise refuse(path.name, f"cannot be read in parts: {obstacle}; give one file")
    if obstacle:
        return None
    names = pq.read_schema(files[0]).names
    known = [name for name in names if name in _known_columns(simulation)]
    taken = {name: name for name in known if name not in _outputs(simulation)}
    count, digest = _checked(simulation, files, taken, path.name)
    unused = [name for name in names if name not in known]
    lines = [f"{path.name}: {count} rows; parquet, read in batches; columns {', '.join(taken)}"]
    understood([*lines, *([f"not used: {', '.join(unused)}"] if unused else [])])
    notes(remarks(simulation.model, list(taken), known, path.name))
    return ParquetRows(files, taken, count, digest)


def _files(path: Path) -> list[Path]:
    """The Parquet files of a directory, or a long one; none for what is read as a whole."""
    if path.is_dir():
        paths = sorted(file for file in path.glob("*.parquet") if not file.name.startswith(("_", ".")))
        if not paths:
            raise refuse(path.name, "is a directory without Parquet files (*.parquet)")
        return paths
    if path.suffix.lower() not in tables.PARQUET or not path.is_file():
        return []
    try:
        return [path] if pq.read_metadata(path).num_rows > LONG else []
    except (OSError, pa.ArrowException):
        return []  # its faults are those of any table


def _obstacle(simulation: Simulation, files: list[Path], uses: Mapping[str, tables.ColumnUse] | None) -> str:
    """Why files cannot be read in batches, empty where they can."""
    try:
        schemas = [pq.read_schema(file) for file in files]
    except (OSError, pa.ArrowException) as error:
        raise refuse(files[0].parent.name, f"holds a file that is not Parquet ({error})") from error
    if any(schema.names != schemas[0].names for schema in schemas):
        return "its files have different columns"
    if uses:
        return "[columns] states what the columns are"
    if simulation.effects:
        return "effects need the table as a whole"
    if not simulation.model.row_by_row(schemas[0].names):
        return "several rows are about one unit"
    missing = [c.name for c in simulation.model.columns if c.needed and c.name not in schemas[0].names]
    if missing:
        return f"it has no column {', '.join(missing)}"
    labels = {c.name for c in simulation.model.columns if c.text} | {"session"}
    for name in set(schemas[0].names) & _known_columns(simulation) - labels - _outputs(simulation):
        kind = schemas[0].field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            return f"column {name} holds no numbers ({kind})"
    return ""


def _known_columns(simulation: Simulation) -> set[str]:
    return set(units_of(simulation.model)) | {"repeat", "session"}


def _outputs(simulation: Simulation) -> set[str]:
    return {output.name for output in simulation.model.outputs}


def _checked(simulation: Simulation, files: list[Path], names: Mapping[str, str], place: str) -> tuple[int, str]:
    """How many rows there are, and their digest. Raises InputError with the faults of cells."""
    count, digest, faults = 0, hashlib.sha256(), list[Fault]()
    for columns in batches(files, names):
        length = len(next(iter(columns.values())))
        index = pd.RangeIndex(count + 1, count + 1 + length)
        faults += typed_inputs(simulation.model, pd.DataFrame(columns, index=index), place)[1]
        digest.update(digest_of(columns).encode())
        count += length
        if len(faults) >= FAULTS:
            break
    raise_all(faults if count else [Fault(place, "has no rows")])
    return count, digest.hexdigest()
