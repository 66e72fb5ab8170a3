"""Outputs that a promise adds to a problem, and limits that mean it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..declarations import Output
from ..errors import Fault
from .promise import ASSURANCE, ASSURED, PLUG_IN, PROMISED, YIELD, Promise
from .settings import Bound


def outputs_of_promise(promise: Promise, prefix: str = "") -> tuple[Output, ...]:
    """The outputs of a promise of one requirement."""
    assured = assurances(f"{prefix}{ASSURANCE}")
    if promise.statement == PLUG_IN:
        return assured
    what = (
        f"with {promise.confidence_percent:g} % confidence, by the norm"
        if promise.statement == ASSURED
        else "expected over the posterior"
    )
    return (
        Output(
            f"{prefix}{PROMISED}", "percent", f"conforming units {what}", larger_is_better=True, low=0.0, high=100.0
        ),
        *assured,
    )


def assurances(name: str) -> tuple[Output, Output]:
    """An assurance and its standard error."""
    return (
        Output(
            name,
            "percent",
            "probability, over the uncertainty of the processes, that the promised fraction of units conforms",
            larger_is_better=True,
            low=0.0,
            high=100.0,
        ),
        Output(f"{name}_error", "percent", "standard error of the assurance", error_of=name),
    )


def means_promise(name: str, promise: Promise) -> bool:
    """Whether a limit on an output means the promise."""
    return name.split(".")[-1] in (YIELD, promise.of, promise.output)


def contradictions(promise: Promise, given: Mapping[str, Bound]) -> list[Fault]:
    """Limits that ask for another percentage than the promise."""
    return [
        Fault(
            f"limits.{name}",
            f"asks for {_percent(bound)}, but the promise is of {promise.yield_percent:g} %: leave the limit out, or "
            "state the same percentage",
        )
        for name, bound in given.items()
        if means_promise(name, promise) and bound != Bound(low=promise.yield_percent)
    ]


def _percent(bound: Bound) -> str:
    ends = [f"{end:g} % at {side}" for side, end in (("least", bound.low), ("most", bound.high)) if np.isfinite(end)]
    return ", ".join(ends)
