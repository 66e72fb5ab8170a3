"""The measurable model that a configuration asks for."""

from __future__ import annotations

from typing import Any

from .. import registry
from ..errors import refuse
from .configuration import Configuration


def build_model(configuration: Configuration) -> Any:
    """The model at the configuration's parameters; searched variables keep the document's value."""
    if not configuration.model_name:
        raise refuse("model", 'is missing: name a model (see `tolevo list`), model = "..."')
    kind = registry.load("models", configuration.model_name)
    given = configuration.settings
    settings = {v.name: (v, given.variables[v.name]) for v in kind.variables
                if v.name in given.variables}  # fmt: skip
    designs = {
        name: variable.document if setting.value is None else setting.value
        for name, (variable, setting) in settings.items()
    }
    known = {parameter.name for parameter in kind.parameters}
    return kind(
        parameters={name: value for name, value in given.parameters.items() if name in known},
        designs={name: value for name, value in designs.items() if value is not None},
        inputs={name: s.distribution for name, (_, s) in settings.items() if s.distribution},
    )
