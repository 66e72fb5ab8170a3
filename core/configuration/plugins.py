"""Names in a configuration that stand for registered models, problems, algorithms, effects, and
the problems that a model belongs to.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from .. import registry
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
    if isinstance(name, Named):
        return name.original
    return section.attempt(partial(registry.load, group, name), lambda fault: (key, fault.message))


def problem_of(top: Section) -> ProblemClass | None:
    """The class that `problem` names: of this suite, or a wrapper of a plain pymoo problem."""
    loaded = load_named(top, "problem", "problems")
    if loaded is None:
        return None
    if isinstance(loaded, type) and issubclass(loaded, ToleranceProblem):
        return loaded
    return top.attempt(partial(plain_kind, loaded), lambda fault: ("problem", fault.message))


def belongs(problem: str, problem_model: str, model: str, measured: ModelClass) -> bool:
    """Whether a correction of the model named `model` applies to `problem`, whose own model is
    `problem_model`.
    """
    return problem_model == model or problem in measured.corrects


def stranger(problem: str, model: str, measured: ModelClass) -> str:
    """The message for a problem that a model does not belong to."""
    corrected = " or ".join(f'"{name}"' for name in measured.corrects)
    reason = f"it corrects {corrected}" if corrected else "it corrects none (`simulate` takes it)"
    return f'the model {model} does not belong to the problem "{problem}": {reason}'
