"""The run that a gap analysis repeats with the corrected model."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import registry
from ..directory import kind_of, standing
from ..errors import Fault, InputError
from ..problems.interfaces import WithEffects
from ..section import Section
from .configuration import Configuration
from .gap_contradictions import Run
from .labels import KEYS as LABELS
from .measured_files import with_files
from .plugins import belongs, stranger
from .reader import PROBLEM_ONLY, read_table
from .source import load
from .table import TABLE

RUN_KEYS = ("problem", "model", "seed", "parameters", "variables", *LABELS, *PROBLEM_ONLY)


def read_run(top: Section, model: str, table: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], Run | None]:
    """The raw tables of that configuration: of the file that `run` names or, where the analysis is
    itself a run configuration (as `corrected.toml` is), its own; empty for none. The second result
    is the configuration in the file, None where there is none or it is at fault.
    """
    run = top.text("run")
    if "problem" in top:
        if run is not None:
            top.fault("run", "this configuration states a problem itself: leave out run")
        return {key: table[key] for key in RUN_KEYS if key in table}, None
    if run is None:
        return {}, None
    tables, configuration = _read(top, model, folder / run)
    return tables, Run(run, configuration) if configuration is not None else None


def _read(top: Section, model: str, path: Path) -> tuple[dict[str, Any], Configuration | None]:
    faults = mixed(path)
    table = load(path, faults) if not faults else None
    if table is None:
        top.fault("run", "; ".join(f"{fault.place} {fault.message}" for fault in faults))
        return {}, None
    run_faults: list[Fault] = []
    filled = with_files(table, path.parent, run_faults)
    configuration = top.attempt(
        lambda: read_table(filled.table, run_faults, filled.notes), lambda fault: (f"run: {fault.place}", fault.message)
    )
    if configuration is None:
        return {}, None
    if configuration.problem is None:
        top.fault("run", f"{path} has no problem: there is no allocation to repeat")
    elif _belongs(top, model, configuration):
        return filled.table, configuration
    return filled.table, None


def mixed(path: Path) -> list[Fault]:
    """Faults of the result that a file belongs to, where its files do not belong together."""
    if not kind_of(path.parent):
        return []
    here = standing(path.parent)
    return list(here.faults) if here.manifest is None or path.name in here.manifest.files else []


def _belongs(top: Section, model: str, run: Configuration) -> bool:
    """Whether a correction of the model applies to the problem; a fault where it does not."""
    if model == TABLE:
        top.fault(
            "run",
            'model = "table" corrects no problem: leave run out (`simulate` takes its '
            "corrected configuration), or name the model of the problem",
        )
        return False
    try:
        measured = registry.load("models", model)
    except InputError:
        return False  # the name is reported where it stands
    of_problem = run.problem.declaration.model if run.problem else ""
    if not belongs(run.problem_name, of_problem, model, measured):
        text = stranger(run.problem_name, model, measured)
        top.fault("run", f"{text}; name a run configuration of it, or leave run out")
        return False
    return True


def counterparts(text: str) -> dict[str, str]:
    """What each effect of a configuration does in its problem; empty where it does nothing.

    Raises InputError where the text is not a configuration with a problem.
    """
    problem = read_table(tomllib.loads(text), []).problem
    if problem is None:
        return {}
    pairs = zip(problem.settings.effects, WithEffects.of(problem).counterparts(), strict=True)
    return {active.effect.name: counterpart for active, counterpart in pairs}
