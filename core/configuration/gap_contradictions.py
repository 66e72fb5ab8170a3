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
class Own:
    """What the gap configuration itself says of the units."""

    parameters: Mapping[str, Value]
    variables: Mapping[str, VariableSetting]
    effects: tuple[Active, ...]


@dataclass(frozen=True)
class Run:
    """The run whose drawing the units are built to, and how faults and pages call it."""

    name: str
    configuration: Configuration


def check_pair(top: Section, run: Run, built: Built) -> None:
    """Faults where the allocation is of another run, or is not what the run fixes."""
    mine, other = run.configuration, built.run
    if other is not None and other is not mine:
        if other.problem_name != mine.problem_name:
            top.fault(
                "built_to",
                f'is an allocation of another problem: "{other.problem_name}", '
                f'and {run.name} is of "{mine.problem_name}"',
            )
            return
        for name, value in other.settings.parameters.items():
            wanted = mine.settings.parameters.get(name, value)
            if not _same(value, wanted):
                top.fault(
                    "built_to",
                    f"was made for {name} = {shown(value)}, and {run.name} has "
                    f"{shown(wanted)}: name the run that the units were made for",
                )
    problem = mine.problem
    for name, value in built.values.items():
        fixed = None if problem is None else problem.fixed.get(name)
        if fixed is not None and not _same(value, float(fixed)):
            top.fault("built_to", f"has {name} = {value:g}, and {run.name} fixes it at {fixed:g}")
    if problem is not None and built.values:
        missing = [
            v.name
            for v in problem.variables
            if v.name not in built.values and v.name not in problem.fixed
        ]
        if missing:
            top.fault("built_to", f"has no {', '.join(missing)}, which {run.name} searches")


def check_own(top: Section, own: Own, run: Run, built: Built, of_the_bench: Iterable[str]) -> None:
    """Faults where this configuration says other than the run or the allocation."""
    theirs = run.configuration.settings
    section = top.section("parameters")
    for name, value in own.parameters.items():
        wanted = theirs.parameters.get(name, value)
        if name not in of_the_bench and not _same(value, wanted):
            section.fault(
                name,
                f"is {shown(value)} here and {shown(wanted)} in {run.name}: the "
                "units are those of the run; leave it out here, or name the run of the "
                "units that were measured",
            )
    check_values(top, own.variables, built, theirs.variables, run.name)
    values = {one.effect.name: dict(one.values) for one in theirs.effects}
    for at, one in enumerate(own.effects):
        if values.get(one.effect.name, dict(one.values)) != dict(one.values):
            top.fault(
                f"effect[{at}]",
                f"{one.effect.name} has other numbers in {run.name}: leave one of them out",
            )


def check_values(
    top: Section,
    own: Mapping[str, VariableSetting],
    built: Built,
    theirs: Mapping[str, VariableSetting],
    run: str = "",
) -> None:
    """The same of variables: value, mid-limit and distribution."""
    for name, mine in own.items():
        section = top.section("variables").section(name)
        other = theirs.get(name, VariableSetting())
        wanted, place = built.values.get(name), built.source
        if wanted is None:
            wanted, place = other.value, run
        if mine.value is not None and wanted is not None and not _same(mine.value, wanted):
            section.fault(
                "value", f"is {mine.value:g} here and {wanted:g} in {place}: leave it out here"
            )
        if mine.mid is not None and other.mid is not None and not _same(mine.mid, other.mid):
            section.fault(
                "mid", f"is {mine.mid:g} here and {other.mid:g} in {run}: leave it out here"
            )
        law = other.distribution or Uniform()
        if name in theirs and mine.distribution not in (None, law):
            section.fault("distribution", f"is another one in {run}: leave it out here")


def _same(one: Value, other: Value) -> bool:
    """Whether two values are equal, numbers but for rounding."""
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=CLOSE, abs_tol=1e-12)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        return len(one) == len(other) and all(map(_same, one, other))
    return one == other
