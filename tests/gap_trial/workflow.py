"""The workflow under trial, as a user has it: a configuration and a table in, `gap.json` out."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from typer.testing import CliRunner

from tests.gap_trial.records import Record
from tolevo.cli import app


def analysed(found: Record) -> dict[str, Any]:
    """What `tolevo gap` writes to `gap.json`. Raises RuntimeError where it ends in a fault."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        configuration, table = place / f"{found.name}.toml", place / f"{found.name}.csv"
        configuration.write_text(found.configuration, encoding="utf-8")
        found.table.to_csv(table, index=False)
        out = place / "found"
        words = ["gap", str(configuration), str(table), "--out", str(out), "--quiet"]
        ended = CliRunner().invoke(app, words)
        if ended.exit_code != 0:
            raise RuntimeError(f"{found.name}: status {ended.exit_code}\n{ended.output}")
        said: dict[str, Any] = json.loads((out / "gap.json").read_text(encoding="utf-8"))
        return said
