"""Faults of a stack as a whole: samples, units of objectives, yields and tolerances that limits rule out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...errors import Fault
from ...models.stack.mechanism import half_width, interpolate_designs, joint_yield_percent
from ...section import Need, Section, too_many
from ..settings import PROMISED, YIELD
from .convex import has_process_within_limits, range_of
from .definition import Requirement
from .outputs import VARIATIONS, common_unit
from .promises import Measured, promise_faults

if TYPE_CHECKING:
    from .problem import Stack

FIFTY_PERCENT = 50.0
"""Percent that no yield reaches where the mean is outside of the limits."""
TRIED = 9
"""Designs between the tightest and the loosest whose yield is tried."""
DEVIATIONS = Need("deviation", bytes=16.0)
"""Memory of every piece of every unit of the sample: a point, and the deviation."""


def faults_of(stack: Stack, inherited: Callable[[], list[Fault]]) -> list[Fault]:
    """Every fault; where the sample is too large, faults of any problem are not sought."""
    faults = promise_faults(stack.definition, stack.given.limits)
    faults += size_faults(stack) or inherited()
    faults += [*yield_faults(stack), *first_order_faults(stack), *range_faults(stack)]
    return faults or domain_faults(stack)


def unit_faults(requirements: Sequence[Requirement], objectives: Sequence[str], limits: Sequence[str]) -> list[Fault]:
    """Objectives and limits over requirements whose units differ."""
    if not requirements[0].key or common_unit(requirements) is not None:
        return []
    units = ", ".join(f'{requirement.key} in "{requirement.unit}"' for requirement in requirements)
    places = [("objectives.minimise", name) for name in objectives if name in VARIATIONS]
    places += [(f"limits.{name}", name) for name in limits if name in VARIATIONS]
    return [
        Fault(
            place,
            f"{name} is over requirements of different units ({units}): name a single requirement, like "
            f"{requirements[0].key}.{name}, or give all of them the same unit",
        )
        for place, name in places
    ]


def size_faults(stack: Stack) -> list[Fault]:
    """A sample of too many pieces."""
    pieces, samples = len(stack.definition.mechanism.owner), stack.settings.propagation.samples
    complaint = too_many(samples, DEVIATIONS, pieces, "samples x pieces")
    return [Fault("propagation.samples", complaint)] if complaint else []


def yield_faults(stack: Stack) -> list[Fault]:
    """Yields that are asked for of requirements without limits."""
    faults = []
    for measured in stack.measured:
        if measured.name("yield_percent") in stack.required_outputs and not measured.mechanism.bounded:
            place = measured.requirement.place
            text = f"needs {place}.lower, {place}.upper or both: without them there is no yield"
            faults.append(Fault(f"limits.{measured.name('yield_percent')}", text))
    bounded = any(measured.mechanism.bounded for measured in stack.measured)
    if stack.definition.requirement.key and "yield_percent" in stack.required_outputs and not bounded:
        text = "needs lower or upper of a [[requirement]]: without them there is no yield"
        faults.append(Fault("limits.yield_percent", text))
    return faults


def first_order_faults(stack: Stack) -> list[Fault]:
    """Promises over a formula that its slopes at the mid-limits do not describe."""
    faults = []
    for measured in (measured for measured in stack.measured if measured.rough and measured.mechanism.bounded):
        if stack.definition.promise is not None:
            why = (
                f"follows from slopes at the mid-limits, and {measured.requirement.place}.formula has none there by "
                f"{', '.join(measured.mechanism.rough)}; leave [promise] out, and limit {measured.name(YIELD)}"
            )
            faults.append(Fault("promise", why))
    return faults


def nominal_limit_faults(stack: Stack, unreachable: Sequence[Fault]) -> list[Fault]:
    """Limits that no design reaches; where the nominal values break a limit already, that fault."""
    asked = {limit.name: limit.low for limit in stack.limits}
    covered, faults = set(), []
    for measured in stack.measured:
        for name in dict.fromkeys((measured.name(YIELD), measured.name(PROMISED), YIELD)):
            if asked.get(name, 0.0) > FIFTY_PERCENT and measured.off_nominal and _never_half(stack, measured):
                covered.add(f"limits.{name}")
                text = (
                    f"{measured.off_nominal}: whatever the tolerances, fewer than half of the units conform, but "
                    f"{asked[name]:g} % are required; move the nominal values or the limits"
                )
                faults.append(Fault(measured.requirement.place, text))
    return [*faults, *(fault for fault in unreachable if fault.place not in covered)]


def _never_half(stack: Stack, measured: Measured) -> bool:
    """Whether fewer than half of the units conform: proven of even deviations about a mean that no
    tolerance moves, else of no design between the tightest and the loosest tolerances by a sample.
    """
    if measured.off_limits or any(part.by_machine or part.alternatives for part in measured.parts):
        return measured.off_limits
    line = interpolate_designs(*stack.ends_as_made, np.linspace(0.0, 1.0, TRIED)[:, None])
    percent, _ = joint_yield_percent([measured.mechanism], line, stack.yields.searching)
    return bool(np.all(percent < FIFTY_PERCENT))


def domain_faults(stack: Stack) -> list[Fault]:
    """Half-widths of requirements that have no value for some units of every design."""
    faults = []
    for measured in stack.measured:
        if measured.requirement.method != "monte_carlo":
            continue
        ends = stack.parts_as_made(stack.corner(tight=True)[None, :])
        coverage = stack.settings.propagation.coverage
        width = half_width(measured.mechanism, ends, stack.yields.searching, coverage)
        if not np.isfinite(width[0]):
            text = "the formula has no value for some units even at the tightest tolerances; tighten the ranges"
            faults.append(Fault(f"{measured.requirement.place}.formula", text))
    return faults


def range_faults(stack: Stack) -> list[Fault]:
    """Least tolerances that contradict an upper limit on a variation, both named."""
    if any(part.by_machine for part in stack.definition.parts):
        return []
    low, _ = stack.ends_of_t
    limits = {part.name: range_of(stack, part)[0] for part in stack.definition.parts}
    moved = np.maximum(low, list(limits.values()))
    if np.all(moved == low) or not has_process_within_limits(stack):
        return []
    faults = []
    for measured in stack.measured:
        variations, least = measured.variations(moved[None, :]), measured.variations(low[None, :])
        for limit in stack.limits:
            if limit.name not in variations or stack.negative:
                continue
            if not least[limit.name][0] <= limit.high < variations[limit.name][0]:
                continue
            names = [f"{name}_t" for at, name in enumerate(limits) if moved[at] > low[at]]
            text = (
                f"at most {limit.high:.6g} {limit.unit} contradicts the least tolerance that "
                f"limits.{', limits.'.join(names)} require: with it the least {limit.name} is "
                f"{variations[limit.name][0]:.6g}, without it {least[limit.name][0]:.6g}; raise this limit or lower "
                "that on the tolerance"
            )
            faults.append(Fault(f"limits.{limit.name}", text))
    return faults


def read_output_names(top: Section) -> tuple[list[str], list[str]]:
    """Names of objectives and limits, as far as they can be read."""
    names, limits = top.section("objectives").take("minimise"), top.section("limits")
    named = [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
    return named, list(limits.all_keys())
