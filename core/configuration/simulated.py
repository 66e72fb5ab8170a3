"""The measurable model that a configuration asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from .. import registry
from ..errors import refuse
from .configuration import Configuration
from .table import TABLE, table_model
from .variables import mid_parameter


def build_model(configuration: Configuration) -> Any:
    """The model at the configuration's parameters; searched variables keep the document's value."""
    if not configuration.model_name:
        raise refuse("model", 'is missing: name a model (see `tolevo list`), model = "..."')
    if configuration.model_name == TABLE:
        return table_model(configuration.settings.definition, configuration.settings.gear)
    return registry.load("models", configuration.model_name)(**arguments_of(configuration))


def arguments_of(configuration: Configuration) -> dict[str, Any]:
    """The arguments of the registered model of a configuration: parameters, designs, inputs."""
    kind = registry.load("models", configuration.model_name)
    stated = configuration.settings
    settings = {v.name: (v, stated.variables[v.name]) for v in kind.variables if v.name in stated.variables}
    designs = {
        name: variable.document if setting.value is None else setting.value
        for name, (variable, setting) in settings.items()
    }
    known = {parameter.name for parameter in kind.parameters}
    parameters = {name: value for name, value in stated.parameters.items() if name in known}
    for name, (_, setting) in settings.items():
        mid = mid_parameter(name)
        if setting.centre is not None and mid in known:
            parameters[mid] = setting.centre
    return {
        "parameters": parameters,
        "designs": {name: value for name, value in designs.items() if value is not None},
        "inputs": {name: s.distribution for name, (_, s) in settings.items() if s.distribution},
    }


def rebuilt(configuration: Configuration, parameters: Mapping[str, Any]) -> Any:
    """The model with some of its parameters changed; those of tables have dotted names, and a
    mid-limit is that of its variable as well.
    """
    changed = dict(configuration.settings.parameters)
    variables = dict(configuration.settings.variables)
    for name in variables:
        if (mid := parameters.get(mid_parameter(name))) is not None:
            variables[name] = replace(variables[name], mid=float(mid))
    for name, value in parameters.items():
        table, dot, key = name.partition(".")
        if dot:
            known = changed.get(table)
            changed[table] = {**(known if isinstance(known, Mapping) else {}), key: value}
        else:
            changed[name] = value
    settings = replace(configuration.settings, parameters=changed, variables=variables)
    return build_model(replace(configuration, settings=settings))
