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
    parameters = {name: value for name, value in given.parameters.items() if name in known}
    for name, (_, setting) in settings.items():
        mid = f"{name.removesuffix('_um')}_mid_um"
        if setting.mid is not None and mid in known:
            parameters[mid] = setting.mid
    return kind(
        parameters=parameters,
        designs={name: value for name, value in designs.items() if value is not None},
        inputs={name: s.distribution for name, (_, s) in settings.items() if s.distribution},
    )
