"""The files of a run. Each appears whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...files import write_bytes, write_text, write_with
from ...records import RunResult
from ...reports.figure import png, svg
from ...reports.page import page


def write(result: RunResult, folder: Path) -> None:
    """Write everything that the contract lists into `folder`, the summary last."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "config.toml", result.configuration)
    write_text(folder / "front.csv", result.front.to_csv(index=False))
    write_with(folder / "front.parquet", lambda path: result.front.to_parquet(path, index=False))
    write_text(folder / "front.json", as_json(_records(result.front)))
    _write_before(result, folder)
    write_text(folder / "references.csv", result.references.to_csv(index=False))
    write_text(folder / "convergence.csv", result.convergence.to_csv(index=False))
    write_bytes(folder / "front.png", png(result))
    write_bytes(folder / "front.svg", svg(result))
    write_text(folder / "report.html", page(result))
    write_text(folder / "summary.json", as_json(dict(result.summary)))


def _write_before(result: RunResult, folder: Path) -> None:
    """The front without the effects, where there are any; what an older run left is removed."""
    tables = {"front_without_effects.csv": result.before, "allocation_moved.csv": result.moved}
    for name, frame in tables.items():
        if frame is None:
            (folder / name).unlink(missing_ok=True)
        else:
            write_text(folder / name, frame.to_csv(index=False))


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(k): v for k, v in row.items()} for row in frame.to_dict("records")]


def as_json(value: Any) -> str:
    """JSON text; what is not a finite number is null."""
    return json.dumps(_plain(value), indent=1, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not np.isfinite(value) else value
