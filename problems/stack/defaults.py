"""Settings that follow from the definition of a stack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..settings import Bound, Settings, VariableSetting
from .definition import Definition
from .measured import Measured
from .promises import promise_limits


def with_defaults(definition: Definition, measured: Sequence[Measured], given: Settings) -> Settings:
    """With fixed tolerances, the only process of a part, and limits of margins and promises."""
    fixed = {f"{p.name}_t": p.low for p in definition.parts if p.low == p.high}
    fixed |= {f"{p.name}_process": 0.0 for p in definition.parts if p.alternatives and len(p.processes) == 1}
    variables = {name: VariableSetting(value=value) for name, value in fixed.items()}
    limits = {
        requirement.name("domain_margin"): Bound(low=0.0) for requirement in measured if requirement.bound_to_domain
    }
    limits |= promise_limits(definition, given.limits)
    return replace(given, variables=variables | dict(given.variables), limits=limits)
