"""`tolevo simulate`: a model's predictions at given operating points."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from .. import tables
from ..blocks import Computed, FrameRows, ParquetRows, Rows, batches, digest_of
from ..errors import Fault, raise_all, refuse
from ..models.effects.measurements import Active, predicted, target_of
from ..models.measurable import MeasurableModel, MeasuredTable, ranks_of_units

GRAIN = 65_536
"""Rows that are predicted at once, from their own stream of random numbers."""
ALWAYS_ALLOWED = ("time_s", "repeat", "session")
OUTSIDE = "outside_record"
"""The column that names the inputs by which a row leaves the record."""
LABELS = ("session",)
"""Of these, the columns of text."""


@dataclass(frozen=True)
class Simulation:
    """What predicts a table: the model (effects refer to its `name`), the effects that are active
    in it, the offsets that are added to its outputs (`zero`), and the ranges of the inputs in the
    measurements that the effects were found in (`record`).
    """

    model: MeasurableModel
    seed: int = 0
    name: str = ""
    effects: tuple[Active, ...] = ()
    zero: Mapping[str, float] = field(default_factory=dict)
    record: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def outside(self, columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[np.bool_]]:
        """Which rows (n,) leave the record that effects were found in, by the input that does."""
        names = [name for name in self.record if name in columns and self.effects]
        ends = {name: self.record[name] for name in names}
        rows = {name: (columns[name] < low) | (columns[name] > high) for name, (low, high) in ends.items()}
        return {name: beyond for name, beyond in rows.items() if beyond.any()}

    def __call__(self, columns: Mapping[str, NDArray[Any]], number: int) -> pd.DataFrame:
        """The inputs of a grain of rows, followed by the predicted outputs."""
        table = dict(columns)
        count = len(next(iter(table.values()), ()))
        if self._apart(tuple(table)) and count > GRAIN:  # grains of units by their numbers, back in the order of rows
            ranks = ranks_of_units(table)
            order = np.argsort(ranks)
            parts = [
                self({name: values[order[start : start + GRAIN]] for name, values in table.items()}, start // GRAIN)
                for start in range(0, count, GRAIN)
            ]
            return pd.concat(parts, ignore_index=True).iloc[ranks].reset_index(drop=True)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(number,) if number else ()))
        whole = predicted(self.model, self.name, table, self.effects, rng, self.zero, self.record)
        if left := self.outside(table):
            again = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(number,) if number else ()))
            plain = predicted(self.model, self.name, table, (), again, self.zero)
            names = np.full(count, "", dtype=object)
            for name, beyond in left.items():
                names[beyond] = np.where(names[beyond] == "", name, names[beyond] + f", {name}")
            whole |= {f"{name}_correction": whole[name] - plain[name] for name in whole}
            whole[OUTSIDE] = names
        return pd.DataFrame({**table, **whole})

    def _apart(self, columns: tuple[str, ...]) -> bool:
        """Whether the rows of a table with these columns are predicted independently."""
        return not self.effects and self.model.row_by_row(columns)

    def computed(self, rows: Rows, columns: Iterable[str], configuration: str = "") -> Computed:
        """The table of these rows, to be computed in blocks.

        Effects need a table as a whole (its order in time, its lots), and so do models several rows
        of which are about one unit: such a table is one block, and so is one in memory whose units are
        not in the order of their numbers.
        """
        grain = GRAIN if self._apart(tuple(columns)) else max(rows.count, 1)
        if grain < rows.count and isinstance(rows, FrameRows) and "unit" in rows.columns:
            in_order = not np.any(np.diff(ranks_of_units(rows.columns)) < 0)
            grain = grain if in_order else rows.count
        return Computed("simulate", self, configuration, rows, grain)


def inputs_in(
    simulation: Simulation,
    table_read: tables.Table,
    place: str,
    uses: Mapping[str, tables.ColumnUse] | None = None,
    understood: tables.Tell = tables.discard_lines,
    notes: tables.Tell = tables.discard_lines,
) -> pd.DataFrame:
    """The inputs in a table, which faults call `place`; measured outputs in it are left out.

    `uses` says what the columns of the file are. `understood` is called with the interpretation of
    the table, `notes` with what the user should know: optional columns that are missing, and
    columns that were left out. Raises InputError with every fault.
    """
    model = simulation.model
    fitted = tables.fit_columns(table_read, place, units_of(model), uses)
    frame, faults, unused = typed_inputs(model, fitted.cells, place)
    raise_all([*faults, *fitted.faults])
    understood([*table_read.lines(place), *fitted.notes, *unused])
    table = {str(name): frame[name].to_numpy() for name in frame}
    raise_all(_effect_faults(simulation, table, place))
    notes(remarks(model, list(map(str, frame)), list(map(str, fitted.cells)), place))
    notes(_range_notes(simulation, table, place))
    return frame


def _range_notes(simulation: Simulation, table: Mapping[str, NDArray[Any]], place: str) -> list[str]:
    """How many rows leave the record that the effects were found in, and what of these is taken there."""
    left = simulation.outside(table)
    if not left:
        return []
    count = int(np.count_nonzero(np.any(list(left.values()), axis=0)))
    inputs = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in simulation.record.items() if name in left)
    named = [active.effect.name for active in simulation.effects if not active.effect.holds_at_ends]
    parts = [f"{', '.join(named)} by {'its formula' if len(named) == 1 else 'their formulas'}"] if named else []
    if len(named) < len(simulation.effects):
        parts.append("terms without a name as at the end of the range")
    return [
        f"{place}: {count} of {len(next(iter(left.values())))} rows leave the record that the correction was found in "
        f"({inputs}); there it takes {' and '.join(parts)}: no measurement supports that (column {OUTSIDE})"
    ]


def remarks(model: MeasurableModel, columns: Sequence[str], file_columns: Sequence[str], place: str) -> list[str]:
    """What the user should know: `columns` are used, `file_columns` are those of the file."""
    messages = [
        f"{place}: no column {c.name} (optional: {c.meaning}); the model's nominal value is taken"
        for c in model.columns
        if c.name not in columns
    ]
    measured = ", ".join(o.name for o in model.outputs if o.name in file_columns)
    if measured or isinstance(model, MeasuredTable):
        named = measured or ", ".join(o.name for o in model.outputs)
        messages.append(f"{place}: {named} as written are predictions with the effects in them, not the measurements")
    return messages


def _effect_faults(simulation: Simulation, table: dict[str, NDArray[Any]], place: str) -> list[Fault]:
    """A fault for each effect that does not apply to the table, as where a column is missing."""
    target = target_of(simulation.model, simulation.name, table)
    faults = []
    for active in simulation.effects:
        if not active.effect.applies(target):
            missing = [role for role in active.effect.needs if role not in target.roles()]
            needed = f"needs a column of {' and '.join(missing)}"
            reason = needed if missing else f"does not apply: {active.effect.left_out(target)}"
            faults.append(Fault(place, f"the effect {active.effect.name} {reason}"))
    return faults


def units_of(model: MeasurableModel) -> dict[str, str]:
    """The unit of every column that a table of the model can have, by name."""
    columns = {column.name: column.unit for column in model.columns}
    outputs = {output.name: output.unit for output in model.outputs}
    stds = {f"{name}_std": unit for name, unit in outputs.items()}
    return {"time_s": "s"} | stds | columns | outputs


def typed_inputs(
    model: MeasurableModel, raw_cells: pd.DataFrame, place: str
) -> tuple[pd.DataFrame, list[Fault], list[str]]:
    """The typed inputs, every fault of the table, and the notes on columns that are not used."""
    outputs = [output.name for output in model.outputs]
    ignored = model.ignored if isinstance(model, MeasuredTable) else ()
    known = [*(c.name for c in model.columns), *ALWAYS_ALLOWED, *(f"{name}_std" for name in outputs)]
    cells = raw_cells.drop(columns=[*outputs, *ignored], errors="ignore")
    cells, unused = tables.drop_unused(cells, known)
    frame, faults = tables.parse_columns(
        cells,
        place,
        needed=[c.name for c in model.columns if c.needed],
        optional=known,
        text=[*(c.name for c in model.columns if c.text), *LABELS],
    )
    return frame, faults, unused


def rows_of(frame: pd.DataFrame) -> FrameRows:
    """The rows of a frame as they are handed out."""
    return FrameRows({str(name): frame[name].to_numpy() for name in frame}, len(frame))


# Operating points too many to be held at once: Parquet files that are read batch by batch.


STREAMED_ROWS = 1_000_000
"""Rows from which on a file is read in batches."""
FAULTS = 50
"""Faults after which a long table is not checked further."""


def streamed(
    simulation: Simulation,
    path: Path,
    uses: Mapping[str, tables.ColumnUse] | None = None,
    understood: tables.Tell = tables.discard_lines,
    notes: tables.Tell = tables.discard_lines,
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
    count, digest = _check_files(simulation, files, taken, path.name)
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
        return [path] if pq.read_metadata(path).num_rows > STREAMED_ROWS else []
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


def _check_files(simulation: Simulation, files: list[Path], names: Mapping[str, str], place: str) -> tuple[int, str]:
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
