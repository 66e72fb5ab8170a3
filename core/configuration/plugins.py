"""Names in a configuration that stand for registered models, problems, algorithms, effects."""

from __future__ import annotations

from typing import Any

from .. import registry
from ..errors import InputError
from ..models.measurable import MeasurableModel
from ..problems.plain import PlainKind, plain_kind
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Section
from .named import Named

ModelClass = type[MeasurableModel]
ProblemClass = type[ToleranceProblem] | PlainKind


def load_named(section: Section, key: str, group: str, default: str = "") -> Any:
    """The class that `key` names in the registry `group`, or the object given in its place.

    None, and a fault, where there is neither.
    """
    name = section.text(key)
    if name is None:
        if key in section or not default:
            return None
        name = default
    try:
        return name.original if isinstance(name, Named) else registry.load(group, name)
    except InputError as error:
        for fault in error.faults:
            section.fault(key, fault.message)
    return None


def problem_of(top: Section) -> ProblemClass | None:
    """The class that `problem` names: of this suite, or a wrapper of a plain pymoo problem."""
    loaded = load_named(top, "problem", "problems")
    if loaded is None:
        return None
    if isinstance(loaded, type) and issubclass(loaded, ToleranceProblem):
        return loaded
    try:
        return plain_kind(loaded)
    except InputError as error:
        for fault in error.faults:
            top.fault("problem", fault.message)
    return None
