"""`[[matched]]`: parts that are sorted into classes and matched; how often, with what is left over, and its price."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import Fault, nearest
from ...models.stack.matching import Matching
from ...models.stack.mechanism import Mechanism
from ...section import Array, Assumption, Output, Range, Section
from ...units import converted, family
from .definition import Definition, Part, Sorting

CLASSES = Range(2, 8)
"""Numbers of classes: more are neither measured nor kept apart."""
TELLING = 2.0
"""Standard deviations of the measurement that a class must be wide, so that most of its parts belong there."""
LEFT_OVER, PER_GOOD_UNIT = "left_over_percent", "cost_per_good_unit"


def read_sortings(top: Section, parts: Sequence[Part] | None, faults: list[Fault]) -> tuple[Sorting, ...]:
    """`[[matched]]`, or one `[matched]`; `parts` are None where some are faulty."""
    top.accept(("matched",))
    if "matched" not in top:
        return ()
    single = isinstance(top.take("matched"), dict)
    count = 1 if single else len(top.tables("matched"))
    sections = [top.collecting("matched", faults) if single else top.item("matched", at, faults) for at in range(count)]
    sortings: list[Sorting] = []
    for section in sections:
        names = section.names("parts") or []
        classes = section.integer("classes", CLASSES)
        u_um, price = (section.number(key, unit, Range(low=0.0)) for key, unit in (("u_um", "um"), ("price", "")))
        for key, example in (("parts", '["pin", "bore"]'), ("classes", "4")):
            if key not in section:
                section.fault(key, f"is missing: state {key} = {example}")
        section.finish()
        complete = len(names) == 2 and names[0] != names[1]
        if names and not complete:
            section.fault("parts", f"must name two different parts, got {', '.join(names)}")
        taken = [name for sorting in sortings for name in sorting.parts if name in names]
        obstacles = [f"{name} is sorted and matched already above" for name in taken]
        obstacles += [why for name in names if parts is not None and (why := _obstacle(name, parts))]
        for why in obstacles:
            section.fault("parts", why)
        if not complete or obstacles:
            continue
        stated: dict[str, Any] = {"parts": names, "classes": classes}
        stated |= {key: value for key, value in (("u_um", u_um), ("price", price)) if value is not None}
        pair, number = (names[0], names[1]), int(CLASSES.low) if classes is None else classes
        sorting = Sorting(pair, number, u_um or 0.0, price or 0.0, section.place(), stated)
        if classes is not None and parts is not None and (why := _too_narrow(sorting, parts)):
            section.fault("classes", why)
        sortings.append(sorting)
    return tuple(sortings)


def _obstacle(name: str, parts: Sequence[Part]) -> str:
    """Why a part cannot be sorted and matched, empty where it can."""
    part = next((part for part in parts if part.name == name), None)
    if part is None:
        return f'"{name}" is not a part{nearest(name, [part.name for part in parts])}'
    if part.feature is not None:
        return f"{name} is a feature of a part, which is not measured alone: name sizes"
    if part.count > 1:
        return f"{name} is built in {part.count} times: only a part that a unit has once is matched"
    if part.by_machine or part.sample is not None:
        return f"{name} is measured or made by machines: only a part whose scatter follows its tolerance is matched"
    if family(part.unit)[0] != "meter":
        return f"{name} is in {part.unit}: u_um is the accuracy of a measured length"
    return ""


def _too_narrow(sorting: Sorting, parts: Sequence[Part]) -> str:
    """Why the measurement cannot tell the classes apart even at the widest tolerances, empty where it can."""
    reasons = []
    for part in parts:
        width = 2.0 * converted(part.high, part.unit, "um") / sorting.classes
        if part.name in sorting.parts and width < TELLING * sorting.u_um:
            most = int(2.0 * converted(part.high, part.unit, "um") / (TELLING * sorting.u_um))
            remedy = f"take {most} classes at most" if most >= 2 else "do not sort it"
            reasons.append(
                f"classes of {part.name} are at most {width:.3g} um wide, which a measurement with u = "
                f"{sorting.u_um:g} um cannot tell apart (they need {TELLING * sorting.u_um:g} um): {remedy}, or "
                "measure better"
            )
    return "; ".join(reasons)


def matched_mechanisms(
    mechanisms: Sequence[Mechanism], parts: Sequence[Part], sortings: Sequence[Sorting], faults: list[Fault]
) -> tuple[Mechanism, ...]:
    """The mechanisms with matched pieces; a fault for each pair that no requirement sets against each other."""
    if not sortings or not mechanisms:
        return tuple(mechanisms)
    by_name = {part.name: part for part in parts}
    pairs = []
    for sorting in sortings:
        one, other = (mechanisms[0].names.index(name) for name in sorting.parts)
        effects = [float(m.sensitivities[one] * m.sensitivities[other]) for m in mechanisms]
        correlation = mechanisms[0].correlation
        text = ""
        if min(effects) >= 0.0:
            text = (
                f"{' and '.join(sorting.parts)} do not mate: no requirement depends on both with opposite signs, so "
                "that like classes compensate nothing"
            )
        elif correlation is not None and any(np.count_nonzero(correlation[piece]) > 1 for piece in (one, other)):
            text = f"{' and '.join(sorting.parts)}: parts that are correlated cannot be matched as well"
        if text:
            faults.append(Fault(f"{sorting.place}.parts", text))
            continue
        units = [by_name[name].unit for name in sorting.parts]
        laws = [by_name[name].distribution for name in sorting.parts]
        errors = [float(converted(sorting.u_um, "um", unit)) for unit in units]
        pairs.append(Matching((one, other), (laws[0], laws[1]), sorting.classes, (errors[0], errors[1])))
    return tuple(replace(mechanism, matched=tuple(pairs)) for mechanism in mechanisms)


def outputs_of_matching(sortings: Sequence[Sorting], bounded: bool) -> list[Output]:
    """What is left over and, where there is a yield, the cost of a good unit."""
    if not sortings:
        return []
    worst = "the worst pair of them" if len(sortings) > 1 else "both kinds alike"
    outputs = [Output(LEFT_OVER, "percent", f"matched parts without a mate, {worst}", low=0.0, high=100.0)]
    good = Output(PER_GOOD_UNIT, "", "cost of each unit that conforms, with sorting and parts without a mate", low=0.0)
    return [*outputs, good] if bounded else outputs


def left_over(definition: Definition, t: Array) -> Array:
    """Fractions (n, pairs) of matched parts without a mate at half-widths t (n, parts)."""
    mechanism = definition.mechanism
    rows = [
        [pair.left_over((row[mechanism.owner[pair.pieces[0]]], row[mechanism.owner[pair.pieces[1]]])) for row in t]
        for pair in mechanism.matched
    ]
    return np.array(rows).reshape(len(mechanism.matched), len(t)).T


def factors_of_cost(definition: Definition, t: Array) -> Array:
    """What is paid for a part of a unit (n, parts) over its cost: more of them where some find no mate."""
    factors, lost = np.ones_like(t), left_over(definition, t)
    for at, pair in enumerate(definition.mechanism.matched):
        owners = [definition.mechanism.owner[piece] for piece in pair.pieces]
        factors[:, owners] = 1.0 / (1.0 - lost[:, [at]])
    return factors


def assumptions_of_matching(sortings: Sequence[Sorting]) -> list[Assumption]:
    """What a configuration leaves open, and what is made of parts without a mate."""
    assumed = []
    for sorting in sortings:
        place = f"matched.{'+'.join(sorting.parts)}"
        if "u_um" not in sorting.stated:
            assumed.append(Assumption(f"{place}.u_um", 0.0, "um", "the measurement that sorts the parts has no error"))
        if "price" not in sorting.stated:
            assumed.append(Assumption(f"{place}.price", 0.0, "", "measuring and sorting cost nothing"))
        assumed.append(
            Assumption(f"{place}.left_over", "scrapped", "", "as many are made of both; parts without a mate are lost")
        )
    return assumed
