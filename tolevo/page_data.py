"""The content of a page, stored next to it so that it can be built again: `page.json`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from .files import csv_text, write_bytes
from .records import tables_of

NAME = "page.json"
FORMAT = 1
Result = TypeVar("Result")


def dump_result(result: Any) -> str:
    """A result record (a dataclass whose tables are frames) as JSON."""
    tables = {
        field.name: _table(value)
        for field in fields(result)
        if isinstance(value := getattr(result, field.name), pd.DataFrame)
    }
    hints = _hints(type(result))
    plain = {
        field.name: TypeAdapter(hints[field.name]).dump_python(
            getattr(result, field.name), mode="json", fallback=_python_scalar, warnings="none"
        )
        for field in fields(result)
        if not _is_frame(hints[field.name])
    }
    head = {"kind": type(result).__name__, "format": FORMAT, "version": version("tolevo")}
    return json.dumps(head | {"fields": plain, "tables": tables}, default=_python_scalar) + "\n"


def load_result(kind: type[Result], content: Mapping[str, Any]) -> tuple[Result, list[str]]:
    """The record that `dump_result` wrote, and the names of what is missing or wrong in it.

    Those are empty in the record.
    """
    hints, bad = _hints(kind), list[str]()
    values = dict[str, Any]()
    plain, tables = (_object(content, name) for name in ("fields", "tables"))
    for field in fields(kind):  # type: ignore[arg-type]
        hint = hints[field.name]
        try:
            if _is_frame(hint) and (hint is pd.DataFrame or field.name in tables):
                values[field.name] = _frame(tables[field.name])
            elif _is_frame(hint):
                values[field.name] = None
            else:
                values[field.name] = TypeAdapter(hint).validate_python(plain[field.name])
        except (KeyError, TypeError, ValueError, ValidationError):
            bad.append(field.name)
            values[field.name] = _empty(hint)
    return kind(**values), bad


def _is_frame(hint: Any) -> bool:
    return hint is pd.DataFrame or pd.DataFrame in get_args(hint)


def _python_scalar(value: Any) -> Any:
    """A scalar of numpy as a plain one."""
    return value.item() if isinstance(value, np.generic) else str(value)


def _object(content: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    mapping = content.get(name)
    return mapping if isinstance(mapping, Mapping) else {}


def _hints(kind: type[Any]) -> dict[str, Any]:
    return get_type_hints(kind, localns={"pd": pd})


def _table(frame: pd.DataFrame) -> dict[str, Any]:
    """A frame by columns, with the names of their types."""
    return {
        "index": frame.index.tolist(),
        "columns": [str(name) for name in frame.columns],
        "types": [str(kind) for kind in frame.dtypes],
        "values": [frame[name].tolist() for name in frame.columns],
    }


def _frame(table: Mapping[str, Any]) -> pd.DataFrame:
    columns = zip(table["columns"], table["values"], table["types"], strict=True)
    return pd.DataFrame(
        {name: pd.Series(values, index=table["index"], dtype=kind) for name, values, kind in columns},
        index=table["index"],
    )


def _empty(hint: Any) -> Any:
    if hint is pd.DataFrame:
        return pd.DataFrame()
    if hint is str:
        return ""
    name = str(hint)
    return {} if "Mapping" in name else () if "tuple" in name else None


# The tables that a result declares, as files.


def table_files(result: Any) -> dict[str, bytes]:
    """The content of each table that a result has, by the name of its file; tables by label stand below each other."""
    held = {table.file: getattr(result, name) for name, table in tables_of(result).items()}
    held |= {file: label_tables(frames) for file, frames in held.items() if isinstance(frames, Mapping)}
    return {
        file: frame.to_parquet(index=False) if file.endswith(".parquet") else csv_text(frame).encode()
        for file, frame in held.items()
        if frame is not None
    }


def write_tables(result: Any, folder: Path) -> None:
    """Write the tables that a result has into a directory."""
    for name, content in table_files(result).items():
        write_bytes(folder / name, content)


def label_tables(frames: Mapping[str, pd.DataFrame | None]) -> pd.DataFrame | None:
    """Tables below each other, each with its label; None without any."""
    labelled = [frame.assign(label=label) for label, frame in frames.items() if frame is not None]
    if not labelled:
        return None
    joined = pd.concat(labelled, ignore_index=True)
    return joined[["label", *(name for name in joined if name != "label")]]


# Results as JSON text.


def as_json(value: Any) -> str:
    """JSON text; what is not a finite number is null."""
    return json.dumps(_json_value(value), indent=1, allow_nan=False) + "\n"


def records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a frame by the names of its columns."""
    return [{str(name): value for name, value in row.items()} for row in frame.to_dict("records")]


def _json_value(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if isinstance(value, np.generic):
        return _json_value(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
