"""Reads the configuration of a study: everything is checked before anything runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, replace
from itertools import accumulate
from os.path import abspath
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomli_w

from ...configuration.configuration import Configuration
from ...configuration.cost_files import fill_files
from ...configuration.plugins import merge, read_labels
from ...configuration.reader import read_table
from ...configuration.search import default_algorithm, evaluations, read_search, settings_of
from ...configuration.source import Source, Table, folder_of, load, override
from ...errors import Fault, InputError, nearest, raise_all, refuse
from ...problems.settings import Labels
from ...problems.tolerance_problem import ToleranceProblem
from ...section import EVALUATIONS, POSITIVE, RUNS, SETTINGS, Range, Section, flat, shown, too_many
from .designs import DESIGNS
from .plan import RESPONSES, Design, Factor, Hypothesis, Level, Point, StudyPlan, StudySettings, unsuitable_response

# `[[reading]]`: an interpretation of a figure, to be tested by a study.


BETTER = "better"
EXPECT = (BETTER, "worse")


def read_hypotheses(top: Section, factors: tuple[Factor, ...], responses: tuple[str, ...]) -> tuple[Hypothesis, ...]:
    """The interpretations, each of two levels that the study compares."""
    parsed = [_read_hypothesis(section, factors, responses) for section in top.items("reading")]
    return tuple(hypothesis for hypothesis in parsed if hypothesis is not None)


def _read_hypothesis(section: Section, factors: tuple[Factor, ...], responses: tuple[str, ...]) -> Hypothesis | None:
    figure, says = section.text("figure"), section.text("says")
    key = section.text("key", [factor.key for factor in factors])
    response = section.text("response", responses)
    expect = section.text("expect", EXPECT) or BETTER
    a, b = section.take("a"), section.take("b")
    section.finish()
    for name in ("figure", "says", "key", "response", "a", "b"):
        if name not in section:
            section.fault(name, "is missing")
    factor = next((candidate for candidate in factors if candidate.key == key), None)
    if factor is None or figure is None or says is None or response is None:
        return None
    levels = [_level(section, name, value, factor) for name, value in (("a", a), ("b", b))]
    if levels[0] is None or levels[1] is None:
        return None
    if levels[0] == levels[1]:
        section.fault("b", "is the same level as a")
    return Hypothesis(figure, says, factor.key, levels[0], levels[1], response, expect == BETTER)


def _level(section: Section, name: str, value: Any, factor: Factor) -> Level | None:
    """The level of the factor that is meant; a fault where the study has no such level."""
    for level in factor.grid():
        if level == value and not isinstance(value, bool):
            return level
    if name in section:
        known = [shown(level) for level in factor.grid()]
        section.fault(name, f"is not a level of {factor.key}: {', '.join(known)}{nearest(shown(value), known)}")
    return None


def written(hypotheses: tuple[Hypothesis, ...]) -> list[dict[str, Any]]:
    """The tables that state these interpretations."""
    tables = [asdict(hypothesis) for hypothesis in hypotheses]
    return [table | {"expect": EXPECT[0] if table.pop("better") else EXPECT[1]} for table in tables]


# `[vary]`: the keys of the run configuration that a study varies, and over what.


RANGE_KEYS = ("low", "high", "levels", "log", "integer")
SEED = "seed"


def read_factors(section: Section, table: Table, base: Mapping[str, Any]) -> tuple[Factor, ...]:
    """The factors of `[vary]`; `base` holds the values of the resolved run by dotted key.

    Keys may be quoted ("algorithm.population") or written as tables; both mean the same.
    """
    factors = []
    for key, value in _entries(table).items():
        section.accept([*accumulate(key.split("."), "{}.{}".format)])
        if key == SEED or key.startswith("run."):
            hint = "replicates differ by their seeds: set seeds" if key == SEED else "leave out `run.`"
            section.fault(key, f"cannot be varied: {hint}")
        elif key not in base and (parent := key.rpartition(".")[0]) in base:
            given = f"not a table with {key.rpartition('.')[2]}"
            section.fault(parent, f"must be a list of values or a table with low and high, {given}")
        elif key not in base:
            known = ", ".join(_neighbours(key, base))
            text = f"is not a setting of this run that has a value{nearest(key, base)}"
            section.fault(key, f"{text}; settings of the same table: {known}" if known else text)
        else:
            factors.append(_factor(section, key, value, base[key]))
    section.finish()
    if not factors and not table:
        section.fault("", "is empty: name at least one key of the run configuration")
    return tuple(factor for factor in factors if factor is not None)


def _entries(table: Table) -> dict[str, Any]:
    """Levels or ranges by dotted key."""
    entries: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and not value.keys() & set(RANGE_KEYS):
            entries |= {f"{key}.{rest}": levels for rest, levels in _entries(value).items()}
        else:
            entries[key] = value
    return entries


def _neighbours(key: str, base: Mapping[str, Any]) -> list[str]:
    """Keys of the run in the same table."""
    place = key.rpartition(".")[0]
    return [neighbour for neighbour in base if neighbour.rpartition(".")[0] == place and neighbour != SEED]


def _factor(section: Section, key: str, value: Any, base_value: Any) -> Factor | None:
    """A factor from its levels or range; `base_value` is the value in the run configuration."""
    if isinstance(value, list):
        return _levels(section, key, value, base_value)
    if isinstance(value, dict):
        return _range(section, key, value, isinstance(base_value, int) and not isinstance(base_value, bool))
    section.fault(key, f"must be a list of values or a table with low and high, got {shown(value)}")
    return None


def _levels(section: Section, key: str, value: list[Any], base_value: Any) -> Factor | None:
    kinds = {str: (str, "a name"), int: (int, "a whole number")}
    kind, wanted = kinds.get(type(base_value), ((int, float), "a number"))
    if not value:
        section.fault(key, "names no values")
    known = set[Any]()
    for at, level in enumerate(value):
        if not isinstance(level, kind) or isinstance(level, bool):
            section.fault(f"{key}[{at}]", f"must be {wanted}, got {shown(level)}")
            return None
        if level in known:
            section.fault(key, f"names {shown(level)} twice")
            return None
        known.add(level)
    levels = tuple(float(level) if isinstance(base_value, float) else level for level in value)
    return Factor(key, levels, integer=isinstance(base_value, int)) if levels else None


def _range(section: Section, key: str, value: Table, whole: bool) -> Factor | None:
    limits = section.of(key, value)
    low, high = limits.number("low"), limits.number("high")
    count = limits.integer("levels", Range(low=2), SETTINGS)
    log, integer = limits.flag("log") or False, limits.flag("integer")
    limits.finish()
    if low is None or high is None:
        if "low" not in value or "high" not in value:
            section.fault(key, "needs low and high")
        return None
    if low >= high:
        section.fault(key, f"low must be below high, got low = {low:g} and high = {high:g}")
        return None
    if log and low <= 0.0:
        section.fault(key, f"a logarithmic range must begin above 0, got low = {low:g}")
        return None
    integer = whole if integer is None else integer
    if integer and (low != int(low) or high != int(high)):
        section.fault(key, f"is a whole number, got low = {low:g} and high = {high:g}")
        return None
    return Factor(key, (), low, high, log, integer, count)


def variable_table(run: Table, keys: Iterable[str], resolved: Mapping[str, Any]) -> Table:
    """The run's tables, those resolved whose short forms the keys lead through.

    `limits.yaw_mrad.max` is a key of the resolved run, where the file may say `yaw_mrad = 0.2`.
    """
    tables = deepcopy(run)
    for key in keys:
        if not merge(deepcopy(tables), _nest_value(key, 0.0)):
            top = key.split(".")[0]
            tables[top] = deepcopy(resolved[top])
    return tables


def replace_values(table: Table, values: Mapping[str, Level]) -> Table:
    """A copy of the run's tables with other values of some keys (dotted)."""
    copy = deepcopy(table)
    for key, value in values.items():
        merge(copy, _nest_value(key, value))
    return copy


def _nest_value(key: str, value: Any) -> Table:
    for name in reversed(key.split(".")):
        value = {name: value}
    nested: Table = value
    return nested


def base_values(run: Table, resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and names of a run by dotted key, as its file and as its resolved form have them."""
    written = {k: float(v) if isinstance(v, int) else v for k, v in _scalar_entries(run).items()}
    return written | _scalar_entries(resolved)


def _scalar_entries(table: Mapping[str, Any]) -> dict[str, Any]:
    """Values that can be varied: no truth values, no lists."""
    return {
        key: value
        for key, value in flat(table).items()
        if isinstance(value, int | float | str) and not isinstance(value, bool)
    }


# Every point of a design, read as a run configuration.


SHOWN = 10
"""Faults of points that are listed; the rest is counted."""


def build_points(
    design: pd.DataFrame, factors: tuple[Factor, ...], base: Configuration, run: Table
) -> tuple[tuple[Point, ...], tuple[ToleranceProblem, ...]]:
    """What runs at each point, and the different problems among them.

    Raises InputError with the faults of all points, each named once.
    """
    builder = _Builder(variable_table(run, [factor.key for factor in factors], base.resolved))
    faults: dict[str, Fault] = {}
    points = []
    for row in design[[factor.key for factor in factors]].to_dict("records"):
        values = {str(key): _toml_scalar(value) for key, value in row.items()}
        try:
            points.append(builder.point(values))
        except InputError as error:
            for fault in error.faults:
                placed = _place_at_point(fault, values)
                faults.setdefault(str(placed), placed)
    listed = list(faults.values())
    if len(listed) > SHOWN:
        listed = [*listed[:SHOWN], Fault("vary", f"{len(listed) - SHOWN} more faults of this kind")]
    raise_all(listed)
    return tuple(points), tuple(builder.problems)


def thin_design(design: pd.DataFrame, factors: tuple[Factor, ...], most: int) -> pd.DataFrame:
    """At most about `most` rows: the ends of every factor, and the others evenly."""
    if len(design) <= most:
        return design
    rows = set(np.linspace(0, len(design) - 1, most).astype(int).tolist())
    for factor in factors:
        order = design[factor.key].astype(str if factor.categorical else float).argsort()
        rows |= {int(order.iloc[0]), int(order.iloc[-1])}
    return design.iloc[sorted(rows)]


class _Builder:
    """Reads points; a problem that several points have in common is built once."""

    def __init__(self, run: Table) -> None:
        self.run = run
        self.problems: list[ToleranceProblem] = []
        self._numbers: dict[str, int] = {}

    def point(self, values: Mapping[str, Level]) -> Point:
        """The point with these values of the varied keys."""
        table = replace_values(self.run, values)
        algorithm = table.pop("algorithm", {})
        key = json.dumps(table, sort_keys=True, default=str)
        if key not in self._numbers:
            return self._first(key, table | {"algorithm": algorithm})
        number = self._numbers[key]
        faults: list[Fault] = []
        section = Section({"algorithm": algorithm}, "", faults).section("algorithm")
        problem = self.problems[number]
        search = read_search(section, problem.n_obj, problem.declaration.algorithm)
        raise_all(faults)
        return Point(number, search["algorithm"], search["budget"], search["engine"])

    def _first(self, key: str, table: Table) -> Point:
        """The first point of a problem."""
        configuration = read_table(table, [])
        assert configuration.problem is not None
        assert configuration.algorithm is not None
        if configuration.start is not None and len(configuration.start.x):
            raise refuse("start", "has no place in a study, whose runs begin from their seeds alone: leave it out")
        self._numbers[key] = len(self.problems)
        self.problems.append(configuration.problem)
        return Point(self._numbers[key], configuration.algorithm, configuration.budget, configuration.engine)


def _place_at_point(fault: Fault, values: Mapping[str, Level]) -> Fault:
    """A fault at the varied key that causes it, else in the run, with the values of the point."""
    if fault.place in values:
        return Fault(f"vary.{fault.place}", fault.message)
    where = ", ".join(f"{key} = {value}" for key, value in values.items())
    return Fault(f"run.{fault.place}", f"{fault.message} (where {where})")


def _toml_scalar(value: Any) -> Level:
    """A value of a table as TOML would give it."""
    plain = value.item() if hasattr(value, "item") else value
    assert isinstance(plain, float | int | str)
    return plain


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
    hopeless = _read_hopeless(top.section("stop"), design)
    top.finish()
    seed, seeds = 0 if seed is None else seed, SEEDS if seeds is None else seeds
    if design is not None and factors and not any(fault.place.startswith("vary") for fault in faults):
        faults += [_place_design_faults(fault) for fault in design.faults(factors, seeds)]
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
    settings = replace(settings, configuration=_resolve_study(settings, base, limit, labels))
    return _plan_study(settings, base, run or {}, limit, most)


def _size_faults(settings: int, seeds: int) -> list[Fault]:
    """A design of too many settings, or of too many runs."""
    if complaint := too_many(settings, SETTINGS):
        return [Fault("design", f"its settings are too many: {complaint}")]
    complaint = too_many(seeds, RUNS, settings, "settings x seeds")
    return [Fault("seeds", complaint)] if complaint else []


def _plan_study(
    settings: StudySettings, base: Configuration, run: Table, limit: float | None, most: int | None
) -> StudyPlan:
    """The plan, once the points of the design have been read as run configurations."""
    rng = np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=DESIGN_STREAM))
    design = settings.design.points(settings.factors, settings.base, rng).reset_index(drop=True)
    chosen = design if most is None else thin_design(design, settings.factors, most)
    points, problems = build_points(chosen, settings.factors, base, run)
    faults = [
        Fault("response", f'"{name}" {text}')
        for name in settings.responses
        for text in dict.fromkeys(unsuitable_response(name, problem) for problem in problems)
        if text
    ]
    searched = {fault for problem in problems for fault in problem.search_faults()}
    faults += sorted((Fault(f"{RUN}.{fault.place}", fault.message) for fault in searched), key=str)
    wanted = sum(evaluations(point.algorithm, point.budget) for point in points)
    evaluations_per_replicate = wanted * len(design) // max(len(points), 1)
    product = "settings x seeds x those of a run"
    if complaint := too_many(settings.seeds, EVALUATIONS, evaluations_per_replicate, product):
        faults.append(Fault("seeds", complaint))
    raise_all(faults)
    return StudyPlan(settings, design, points, problems, limit)


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
    tables: Table = fill_files(run, folder, run_faults).table
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
    name = default_algorithm([*stated, *varied_keys], problem.n_obj, problem.declaration.algorithm)
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


def _read_hopeless(section: Section, design: Design | None) -> bool:
    """Whether settings that are significantly worse are stopped."""
    hopeless = section.flag("hopeless") or False
    section.finish()
    if hopeless and design is not None and design.analysis not in RACED:
        text = f"is not available for {design.kind}, whose statistics need every run"
        section.fault("hopeless", f"{text}; use one of {', '.join(RACED)}")
    return hopeless


def _place_design_faults(fault: Fault) -> Fault:
    """Faults of a design name its own keys, `seeds` or `vary.<key>`."""
    if fault.place == "seeds" or fault.place.startswith("vary") or "/" in fault.place:
        return fault
    return Fault(f"design.{fault.place}", fault.message)


def _resolve_study(study: StudySettings, base: Configuration, limit: float | None, labels: Labels) -> str:
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
