"""The same stack with another promise, or with more known of its processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from ...models.capability import Knowledge
from ...models.stack import Mechanism
from ..promise import Promise
from ..settings import Bound
from .definition import Part

if TYPE_CHECKING:
    from .problem import Stack


def with_statement(stack: Stack, statement: str) -> Stack:
    """The stack with the same promise meant otherwise."""
    promise = stack.definition.promise
    assert promise is not None
    return promising(stack, replace(promise, statement=statement))


def promising(stack: Stack, promise: Promise) -> Stack:
    """The stack with a promise, whose limits take the place of those of the promise before."""
    limits = {
        name: bound for name, bound in stack.given.limits.items() if not name.split(".")[-1].endswith("yield_percent")
    }
    definition = replace(stack.definition, promise=promise)
    return type(stack)(replace(stack.given, definition=definition, limits=limits))


def cheapest_at(stack: Stack, levels: Mapping[str, float]) -> Stack:
    """Least cost alone, at upper limits on outputs."""
    limits = dict(stack.given.limits) | {name: Bound(high=high) for name, high in levels.items()}
    return type(stack)(replace(stack.given, objectives=("cost",), limits=limits))


def with_knowledge(stack: Stack, known: Mapping[str, Knowledge]) -> Stack:
    """The stack with other knowledge of the processes of some measured parts, means included."""
    definition = stack.definition
    parts = tuple(_part(part, known[part.name]) if part.name in known else part for part in definition.parts)
    mechanisms = tuple(_mechanism(mechanism, definition.parts, parts) for mechanism in definition.mechanisms)
    anew = replace(definition, parts=parts, mechanisms=mechanisms)
    return type(stack)(replace(stack.given, definition=anew))


def _part(part: Part, known: Knowledge) -> Part:
    assert part.sample is not None
    offset = known.mean if part.sample.offset else 0.0
    sample = replace(part.sample, knowledge=known, offset=offset)
    return replace(part, sample=sample, distribution=sample.distribution)


def _mechanism(mechanism: Mechanism, before: tuple[Part, ...], parts: tuple[Part, ...]) -> Mechanism:
    """A mechanism of other processes: what a mean moves is taken to be linear."""
    moved = [new.mean - old.mean for old, new in zip(before, parts, strict=True)]
    shift = sum(slope * moved[at] for slope, at in zip(mechanism.sensitivities, mechanism.owner, strict=True))
    mids = mechanism.mids
    if mids is not None and mechanism.scale is not None:
        mids = mids + mechanism.scale * [moved[at] for at in mechanism.owner]
    return replace(
        mechanism, inputs=tuple(part.distribution for part in parts), centre=mechanism.centre + float(shift), mids=mids
    )
