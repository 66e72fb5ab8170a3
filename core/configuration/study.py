"""Reads the configuration of a study: everything is checked before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from os.path import abspath
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ..counts import EVALUATIONS, RUNS, SETTINGS, too_many
from ..errors import Fault, InputError, nearest, raise_all
from ..problems.interfaces import Checks
from ..problems.settings import Labels
from ..section import POSITIVE, Range, Section, flat
from ..workflows.study.designs import DESIGNS
from ..workflows.study.plan import StudyPlan
from ..workflows.study.records import RESPONSES, Design, Factor, StudySettings
from ..workflows.study.responses import unsuitable
from .configuration import Configuration
from .labels import read_labels
from .measured_files import with_files
from .reader import read_table
from .readings import read_hypotheses, written
from .search import by_default, evaluations, settings_of
from .settings_of_points import built_points, some
from .source import Source, Table, folder_of, load, override
from .varied import base_values, read_factors

RUN = "run"
STUDY = "study"
"""Title of a study that is not a file."""
SEEDS = 10
RACED = ("one_at_a_time", "factorial", "table")
"""Analyses of designs whose settings may be stopped."""
DESIGN_STREAM = (0, 0)
"""Spawn key of the generator of the design; the seeds of replicates have keys of one number."""
RESPONSE = ("hypervolume_ratio", "gap_percent")
"""Default response of a front, and of one objective."""


def read_study(source: Source, overrides: Sequence[str] = (), most: int | None = None) -> StudyPlan:
    """The study in a TOML file or dictionary, with `key=value` overrides applied.

    `run.<key>` overrides the run configuration, in a file or in the table. If a design has more
    than `most` settings, only about as many are read as run configurations: such a plan can be
    described, but not run. Raises InputError with every fault.
    """
    faults: list[Fault] = []
    if (table := load(source, faults)) is None:
        raise InputError(faults)
    study_overrides = [setting for setting in overrides if not setting.strip().startswith(f"{RUN}.")]
    override(table, study_overrides, faults)
    top = Section(table, "", faults)
    run = _run_table(top, table, folder_of(source), overrides, faults)
    base = None if run is None else _base(run, top.take("vary"), faults)
    seed, labels = top.integer("seed", Range(low=0), None), read_labels(top)
    seeds = top.integer("seeds", Range(low=1), RUNS)
    limit = top.number("time_limit_s", within=POSITIVE)
    responses = _responses(top, base)
    design = _design(top.section("design"), folder_of(source))
    factors: tuple[Factor, ...] = ()
    vary, varied = top.section("vary"), top.take("vary")
    if base is not None and isinstance(varied, dict | None):
        factors = read_factors(vary, varied or {}, base_values(run or {}, base.resolved))
    hypotheses = read_hypotheses(top, factors, responses)
    hopeless = _hopeless(top.section("stop"), design)
    top.finish()
    seed, seeds = 0 if seed is None else seed, SEEDS if seeds is None else seeds
    if design is not None and factors and not any(fault.place.startswith("vary") for fault in faults):
        faults += [_placed(fault) for fault in design.faults(factors, seeds)]
        faults += _size_faults(design.size(factors), seeds)
    raise_all(faults)
    assert base is not None
    assert design is not None
    values = base_values(run or {}, base.resolved)
    known = base.settings.labels if labels == Labels() else labels
    settings = StudySettings(
        title=known.name or (source.stem if isinstance(source, Path) else STUDY),
        factors=factors,
        design=design,
        responses=responses,
        seeds=seeds,
        seed=seed,
        base={factor.key: values[factor.key] for factor in factors},
        objectives=base.settings.objectives,
        hypotheses=hypotheses,
        labels=known,
        hopeless=hopeless,
    )
    settings = replace(settings, configuration=_resolved(settings, base, limit, labels))
    return _planned(settings, base, run or {}, limit, most)


def _size_faults(settings: int, seeds: int) -> list[Fault]:
    """A design of too many settings, or of too many runs."""
    if complaint := too_many(settings, SETTINGS):
        return [Fault("design", f"its settings are too many: {complaint}")]
    complaint = too_many(seeds, RUNS, settings, "settings x seeds")
    return [Fault("seeds", complaint)] if complaint else []


def _planned(
    settings: StudySettings, base: Configuration, run: Table, limit: float | None, most: int | None
) -> StudyPlan:
    """The plan, once the points of the design have been read as run configurations."""
    rng = np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=DESIGN_STREAM))
    design = settings.design.points(settings.factors, settings.base, rng).reset_index(drop=True)
    chosen = design if most is None else some(design, settings.factors, most)
    points, problems = built_points(chosen, settings.factors, base, run)
    faults = [
        Fault("response", f'"{name}" {text}')
        for name in settings.responses
        for text in dict.fromkeys(unsuitable(name, problem) for problem in problems)
        if text
    ]
    searched = {fault for problem in problems for fault in Checks.of(problem).search_faults()}
    faults += sorted((Fault(f"{RUN}.{fault.place}", fault.message) for fault in searched), key=str)
    wanted = sum(evaluations(point.algorithm, point.budget) for point in points)
    evaluations_per_replicate = wanted * len(design) // max(len(points), 1)
    product = "settings x seeds x those of a run"
    if complaint := too_many(settings.seeds, EVALUATIONS, evaluations_per_replicate, product):
        faults.append(Fault("seeds", complaint))
    raise_all(faults)
    return StudyPlan(settings, design, points, problems, limit)


def is_study(source: Source) -> bool:
    """Whether a configuration is that of a study."""
    table = load(source, [])
    return table is not None and RUN in table and "vary" in table


def _run_table(top: Section, table: Table, folder: Path, overrides: Sequence[str], faults: list[Fault]) -> Table | None:
    """The tables of the run, from the file that is named or inline, with what overrides them."""
    run = top.take(RUN)
    dotted = {key: table[key] for key in table if key.startswith(f"{RUN}.")}
    top.accept(dotted)
    if isinstance(run, str):
        path = Path(abspath(folder / run))
        folder, run = path.parent, load(path, faults)
    elif not isinstance(run, dict):
        text = "is missing: name a run configuration" if run is None else "must be a file name"
        top.fault(RUN, f'{text} (run = "x.toml"), or give a [run] table')
        run = None
    if run is None:
        return None
    run_overrides = [
        setting.strip().removeprefix(f"{RUN}.") for setting in overrides if setting.strip().startswith(f"{RUN}.")
    ]
    lines = [f"{key.removeprefix(f'{RUN}.')}={_toml(value)}" for key, value in dotted.items()]
    override(run, [*lines, *run_overrides], faults)
    run_faults: list[Fault] = []
    tables: Table = with_files(run, folder, run_faults).table
    faults += [Fault(f"{RUN}.{fault.place}", fault.message) for fault in run_faults]
    return tables


def _toml(value: Any) -> str:
    return tomli_w.dumps({"x": value}).partition("=")[2].strip()


def _base(run: Table, varied: Any, faults: list[Fault]) -> Configuration | None:
    """The run as configured, by the algorithm whose settings are `varied`; its faults are added."""
    try:
        configuration = read_table(run, [])
        if _name_algorithm(run, varied, configuration):
            configuration = read_table(run, [])
    except InputError as error:
        faults += [Fault(f"{RUN}.{fault.place}", fault.message) for fault in error.faults]
        return None
    if configuration.problem is None:
        faults.append(Fault(f"{RUN}.problem", "is missing: a model alone can only be simulated"))
        return None
    if not configuration.problem.free:
        faults.append(Fault(f"{RUN}.problem", "every variable is fixed: there is nothing to optimise"))
        return None
    return configuration


def _name_algorithm(run: Table, varied: Any, configuration: Configuration) -> bool:
    """Name the algorithm of a run where it names none and its settings are varied; whether done."""
    stated = run.get("algorithm", {})
    keys = [key.split(".") for key in flat(varied)] if isinstance(varied, dict) else []
    varied_keys = [key[1] for key in keys if key[0] == "algorithm" and len(key) > 1]
    problem = configuration.problem
    if "name" in [*stated, *varied_keys] or not varied_keys or problem is None:
        return False
    name = by_default([*stated, *varied_keys], problem.n_obj, problem.declaration.algorithm)
    run["algorithm"] = stated | {"name": name}
    return True


def _responses(top: Section, base: Configuration | None) -> tuple[str, ...]:
    """The responses, in the order of `RESPONSES`."""
    names = [top.take("response")] if isinstance(top.take("response"), str) else None
    names = names or top.names("response")
    if names is None:
        front = base is None or len(base.settings.objectives) > 1
        return (RESPONSE[0] if front else RESPONSE[1],)
    for name in names:
        if name not in RESPONSES:
            known = ", ".join(RESPONSES)
            top.fault("response", f'must be of {known}, got "{name}"{nearest(name, RESPONSES)}')
    if len(set(names)) < len(names):
        top.fault("response", "lists a response twice")
    return tuple(name for name in RESPONSES if name in names)


def _design(section: Section, folder: Path) -> Design | None:
    """The design with its settings; a file of it is looked for next to the configuration."""
    kind = section.text("kind", DESIGNS)
    if kind is None:
        if "kind" not in section:
            section.fault("kind", f"is missing: one of {', '.join(DESIGNS)}")
        return None
    section.accept(["kind"])
    design = settings_of(section, DESIGNS[kind])
    if getattr(design, "file", ""):
        design = replace(design, file=abspath(folder / design.file))
    assert isinstance(design, Design)
    return design


def _hopeless(section: Section, design: Design | None) -> bool:
    """Whether settings that are significantly worse are stopped."""
    hopeless = section.flag("hopeless") or False
    section.finish()
    if hopeless and design is not None and design.analysis not in RACED:
        text = f"is not available for {design.kind}, whose statistics need every run"
        section.fault("hopeless", f"{text}; use one of {', '.join(RACED)}")
    return hopeless


def _placed(fault: Fault) -> Fault:
    """Faults of a design name its own keys, `seeds` or `vary.<key>`."""
    if fault.place == "seeds" or fault.place.startswith("vary") or "/" in fault.place:
        return fault
    return Fault(f"design.{fault.place}", fault.message)


def _resolved(study: StudySettings, base: Configuration, limit: float | None, labels: Labels) -> str:
    """The study as TOML, every default included; reading it again gives the same study."""
    table: dict[str, Any] = {**labels.stated(), "seed": study.seed, "seeds": study.seeds}
    table |= {"response": list(study.responses)} | ({} if limit is None else {"time_limit_s": limit})
    table |= {"stop": {"hopeless": True}} if study.hopeless else {}
    table |= {"reading": written(study.hypotheses)} if study.hypotheses else {}
    table["design"] = {"kind": study.design.kind} | asdict(study.design)  # type: ignore[call-overload]
    table["vary"] = {factor.key: _vary(factor) for factor in study.factors}
    return tomli_w.dumps(table | {RUN: dict(base.resolved)})


def _vary(factor: Factor) -> Any:
    if factor.levels:
        return list(factor.levels)
    table = {"low": factor.low, "high": factor.high, "log": factor.log, "integer": factor.integer}
    return table | ({} if factor.count is None else {"levels": factor.count})
