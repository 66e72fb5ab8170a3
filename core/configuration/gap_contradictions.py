"""Where a gap analysis of a batch contradicts its run, or the allocation that it names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..declarations import Value
from ..models.effects.compose import Active
from ..models.inputs import Uniform
from ..problems.settings import VariableSetting
from ..section import Section, shown
from .configuration import Configuration
from .gap_built import Built

CLOSE = 1e-9


@dataclass(frozen=True)
class Stated:
    """What the gap configuration itself states about the units."""

    parameters: Mapping[str, Value]
    variables: Mapping[str, VariableSetting]
    effects: tuple[Active, ...]


@dataclass(frozen=True)
class Run:
    """The run whose drawing the units are built to, and its name in faults and on pages."""

    name: str
    configuration: Configuration


def check_pair(top: Section, run: Run, built: Built) -> None:
    """Faults where the allocation is of another run, or is not what the run fixes."""
    configuration, built_run = run.configuration, built.run
    if built_run is not None and built_run is not configuration:
        if built_run.problem_name != configuration.problem_name:
            text = f'is an allocation of another problem: "{built_run.problem_name}"'
            top.fault("built_to", f'{text}, and {run.name} is of "{configuration.problem_name}"')
            return
        for name, value in built_run.settings.parameters.items():
            wanted = configuration.settings.parameters.get(name, value)
            if not _values_equal(value, wanted):
                text = f"was made for {name} = {shown(value)}, and {run.name} has {shown(wanted)}"
                top.fault("built_to", f"{text}: name the run that the units were made for")
    problem = configuration.problem
    for name, value in built.values.items():
        fixed = None if problem is None else problem.fixed.get(name)
        if fixed is not None and not _values_equal(value, float(fixed)):
            top.fault("built_to", f"has {name} = {value:g}, and {run.name} fixes it at {fixed:g}")
    if problem is not None and built.values:
        missing = [v.name for v in problem.variables if v.name not in built.values and v.name not in problem.fixed]
        if missing:
            top.fault("built_to", f"has no {', '.join(missing)}, which {run.name} searches")


def check_stated(top: Section, stated: Stated, run: Run, built: Built, of_the_bench: Iterable[str]) -> None:
    """Faults where this configuration contradicts the run or the allocation."""
    run_settings = run.configuration.settings
    section = top.section("parameters")
    for name, value in stated.parameters.items():
        wanted = run_settings.parameters.get(name, value)
        if name not in of_the_bench and not _values_equal(value, wanted):
            section.fault(
                name,
                f"is {shown(value)} here and {shown(wanted)} in {run.name}: the units are those of the run; leave it "
                "out here, or name the run of the units that were measured",
            )
    check_values(top, stated.variables, built, run_settings.variables, run.name)
    values = {active.effect.name: dict(active.values) for active in run_settings.effects}
    for at, active in enumerate(stated.effects):
        if values.get(active.effect.name, dict(active.values)) != dict(active.values):
            top.fault(f"effect[{at}]", f"{active.effect.name} has other numbers in {run.name}: leave one of them out")


def check_values(
    top: Section,
    stated: Mapping[str, VariableSetting],
    built: Built,
    run_variables: Mapping[str, VariableSetting],
    run: str = "",
) -> None:
    """Faults where value, mid-limit or distribution of a variable contradict the run or the
    allocation.
    """
    for name, setting in stated.items():
        section = top.section("variables").section(name)
        run_setting = run_variables.get(name, VariableSetting())
        wanted, place = built.values.get(name), built.source
        if wanted is None:
            wanted, place = run_setting.value, run
        if setting.value is not None and wanted is not None and not _values_equal(setting.value, wanted):
            section.fault("value", f"is {setting.value:g} here and {wanted:g} in {place}: leave it out here")
        if setting.mid is not None and run_setting.mid is not None and not _values_equal(setting.mid, run_setting.mid):
            section.fault("mid", f"is {setting.mid:g} here and {run_setting.mid:g} in {run}: leave it out here")
        if name in run_variables and setting.distribution not in (None, run_setting.distribution or Uniform()):
            section.fault("distribution", f"is different in {run}: leave it out here")


def _values_equal(first: Value, second: Value) -> bool:
    """Whether two values are equal, numbers up to rounding."""
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=CLOSE, abs_tol=1e-12)
    if isinstance(first, tuple | list) and isinstance(second, tuple | list):
        return len(first) == len(second) and all(map(_values_equal, first, second))
    return first == second
