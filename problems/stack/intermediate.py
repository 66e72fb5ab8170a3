"""Quantities between the parts and the formulas of a stack: `[[let]]` and `[[loop]]` state them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any

from ...errors import Fault
from ...models.expressions import Formula, FormulaError, Intermediate, Let
from ...models.stack.loops import Loops
from ...section import Section, shown
from .definition import Part, Requirement, base_units
from .formulas import name_complaint, unknown_name


@dataclass(frozen=True, slots=True)
class Chain:
    """A loop as it is written: what each of its links adds along each axis, and starts of unknowns.

    `sources` are the texts of its lengths, angles and directions, each with its place.
    """

    place: str
    links: tuple[tuple[str, ...], ...]
    sources: tuple[tuple[str, str], ...]
    start: Mapping[str, float]

    @property
    def axes(self) -> int:
        """2 in the plane, 3 in space."""
        return max(len(link) for link in self.links)

    def along(self, axis: int) -> list[str]:
        """What its links add along an axis."""
        return [link[axis] for link in self.links if axis < len(link)]


def read_intermediate(
    top: Section, parts: Sequence[Part] | None, faults: list[Fault]
) -> tuple[dict[str, Any], tuple[Intermediate, ...]]:
    """The tables `[[let]]` and `[[loop]]` as they are written, and the quantities that they state, each
    after those that it depends on; none where a table, or one of the parts (None), is faulty.
    """
    before = len(faults)
    lets, chains = read_lets(top, faults), _read_loops(top, faults)
    tables = {key: top.take(key) for key in ("let", "loop") if key in top}
    return tables, arranged(lets, chains, parts, faults) if parts is not None and len(faults) == before else ()


def read_lets(top: Section, faults: list[Fault]) -> tuple[Let, ...]:
    """Every `[[let]]` that can be read, with its name and its formula."""
    lets = []
    for at in range(len(top.tables("let"))):
        section = top.item("let", at, faults)
        name, text = _name(section), section.text("formula")
        if "formula" not in section:
            section.fault("formula", 'is missing: write the quantity as a function of parts, like "hub/2 + gap"')
        section.finish()
        formula = None if text is None else _formula(section, "formula", text)
        if name is not None and formula is not None:
            lets.append(Let(name, formula, section.place()))
    return tuple(lets)


def _name(section: Section) -> str | None:
    """The name of a quantity in formulas, None and a fault where it cannot be one."""
    name = section.text("name")
    if "name" not in section:
        section.fault("name", "is missing: formulas use the quantity by its name")
    elif name is not None and (why := name_complaint(name)):
        section.fault("name", why)
        return None
    return name


def _formula(section: Section, key: str, text: str) -> Formula | None:
    """The formula, None and a fault where the text is none."""
    try:
        return Formula(text)
    except FormulaError as error:
        section.fault(key, str(error))
        return None


# Loops: links of a length, along an angle in the plane or along a direction in space.


_WITH_UNIT = re.compile(r"\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[A-Za-z°]\w*\s*")


def _read_loops(top: Section, faults: list[Fault]) -> tuple[Chain, ...]:
    """Every `[[loop]]` that can be read."""
    chains: list[Chain] = []
    for at in range(len(top.tables("loop"))):
        section = top.item("loop", at, faults)
        if section.text("name") is None and "name" not in section:
            section.fault("name", "is missing: name the loop")
        unknown = section.section("unknown")
        start = {name: _start(unknown, name) for name in unknown.all_keys()}
        links = section.items("link")
        if len(links) < 2:
            section.fault(
                "link", "must list at least two [[loop.link]] tables, each with length and angle or direction"
            )
        texts, sources = [], list[tuple[str, str]]()
        for link in links:
            texts.append(_read_link(link, sources))
            link.finish()
        section.finish()
        if len(links) > 1 and all(texts):
            chains.append(Chain(section.place(), tuple(texts), tuple(sources), start))
    return tuple(chains)


def _start(section: Section, name: str) -> float:
    """The start of an unknown, in rad or in the unit of the formulas' lengths."""
    if why := name_complaint(name):
        section.fault(name, why)
    value = section.take(name)
    number = section.as_number(name, value, "rad" if isinstance(value, str) else "")
    return 0.0 if number is None else number


def _read_link(section: Section, sources: list[tuple[str, str]]) -> tuple[str, ...]:
    """What a link adds along each axis; empty and a fault where it does not say."""
    if "length" not in section:
        section.fault("length", "is missing: a number, or a formula of parts and unknowns")
    if ("angle" in section) == ("direction" in section):
        section.fault("angle", "state either the angle in the plane (a formula in rad) or the direction, [x, y, z]")
    length = _text(section, "length", section.take("length"), sources)
    if "angle" in section:
        angle = _text(section, "angle", section.take("angle"), sources, "rad")
        along: tuple[str, ...] = () if angle is None else (f"cos({angle})", f"sin({angle})")
    else:
        along = _along(section, sources)
    terms = () if length is None else tuple(f"({length})*{part}" for part in along)
    return terms if all(_formula(section, "length", term) for term in terms) else ()


def _along(section: Section, sources: list[tuple[str, str]]) -> tuple[str, ...]:
    """The components of a direction of length 1; empty and a fault where there are none."""
    stated = section.take("direction")
    if not isinstance(stated, list) or len(stated) not in (2, 3):
        if "direction" in section:
            section.fault("direction", f"must list two or three numbers or formulas, got {shown(stated)}")
        return ()
    texts = [_text(section, f"direction[{at}]", value, sources) for at, value in enumerate(stated)]
    if any(text is None for text in texts):
        return ()
    if all(isinstance(value, int | float) for value in stated):
        size = math.hypot(*stated)
        if size == 0.0:
            section.fault("direction", "must not be 0 along every axis")
        return tuple(f"({value / (size or 1.0)!r})" for value in stated)
    size_text = "+".join(f"({text})**2" for text in texts)
    return tuple(f"({text})/sqrt({size_text})" for text in texts)


def _text(section: Section, key: str, value: Any, sources: list[tuple[str, str]], unit: str = "") -> str | None:
    """A number or a formula as text; None and a fault where the value is neither."""
    if value is None:
        return None
    if not isinstance(value, str) or (unit and _WITH_UNIT.fullmatch(value)):
        number = section.as_number(key, value, unit)
        text = None if number is None else repr(number)
    else:
        text = None if _formula(section, key, value) is None else value
    if text is not None:
        sources.append((section.place(key), text))
    return text


# The order in which the quantities follow from the parts.


def arranged(
    lets: Sequence[Let], chains: Sequence[Chain], parts: Sequence[Part], faults: list[Fault]
) -> tuple[Intermediate, ...]:
    """The quantities, each after those that it depends on; none and every fault where names are
    ambiguous or unknown, where a quantity depends on itself, or where loops have more or fewer
    unknowns than equations.
    """
    before, places = len(faults), dict[str, str]()
    for part in parts:
        places |= dict.fromkeys(part.names, part.label)
    stated = [(let.name, let.place) for let in lets]
    stated += [(name, f"{chain.place}.unknown") for chain in chains for name in chain.start]
    for name, place in stated:
        if name in places:
            faults.append(Fault(place, f'"{name}" is already a name of {places[name]}; rename one of the two'))
        places.setdefault(name, place)
    texts = [(f"{let.place}.formula", let.formula) for let in lets]
    texts += [(place, Formula(text)) for chain in chains for place, text in chain.sources]
    others = [name for name, _ in stated]
    for place, formula in texts:
        reasons = (unknown_name(name, column, parts, others) for name, column in formula.written.items())
        faults += [Fault(place, why) for why in reasons if why]
    ordered = _ordered(lets, faults)
    if len(faults) > before:
        return ()
    groups = _coupled(chains, tuple(ordered), faults)
    steps = _ordered([*lets, *groups], faults)
    return tuple(steps) if len(faults) == before else ()


def _ordered(steps: Sequence[Intermediate], faults: list[Fault]) -> list[Intermediate]:
    """Each quantity after those that it depends on; a fault where one depends on itself."""
    owner = {name: at for at, step in enumerate(steps) for name in step.names}
    graph = {at: [owner[name] for name in step.inputs if name in owner] for at, step in enumerate(steps)}
    try:
        return [steps[at] for at in TopologicalSorter(graph).static_order()]
    except CycleError as error:
        names = [", ".join(steps[at].names) for at in reversed(error.args[1])]
        text = f"depends on itself: {' -> '.join(names)}; write one of them in terms of parts"
        faults.append(Fault(steps[error.args[1][0]].place, text))
        return []


def _coupled(chains: Sequence[Chain], lets: tuple[Intermediate, ...], faults: list[Fault]) -> list[Loops]:
    """The loops, those that share unknowns together; a fault where unknowns and equations differ in number."""
    used = [
        {name for _, text in chain.sources for name in Formula(text, lets).names} | set(chain.start) for chain in chains
    ]
    unknowns = {name for chain in chains for name in chain.start}
    groups: list[set[int]] = []
    for at, names in enumerate(used):
        joined = [group for group in groups if any(used[other] & names & unknowns for other in group)]
        groups = [group for group in groups if group not in joined] + [{at}.union(*joined)]
    systems = []
    for group in groups:
        own = [chains[at] for at in sorted(group)]
        start = {name: value for chain in own for name, value in chain.start.items()}
        axes = max(chain.axes for chain in own)
        place, equations = ", ".join(chain.place for chain in own), axes * len(own)
        idle = [name for name in start if not any(name in Formula(t, lets).names for c in own for _, t in c.sources)]
        if idle:
            faults.append(Fault(f"{place}.unknown", f"no link depends on {', '.join(idle)}: leave it out"))
        elif len(start) != equations:
            text = (
                f"has {len(start)} unknowns ({', '.join(start) or 'none'}) and {equations} equations "
                f"({axes} for each loop {'in the plane' if axes == 2 else 'in space'}): state as many unknowns, each "
                "with a start"
            )
            faults.append(Fault(f"{place}.unknown", text))
        else:
            systems.append(
                Loops(
                    unknowns=tuple(start),
                    start=tuple(start.values()),
                    equations=tuple(
                        tuple(Formula(text, lets) for text in chain.along(axis))
                        for chain in own
                        for axis in range(axes)
                    ),
                    sources=tuple((place, Formula(text, lets)) for chain in own for place, text in chain.sources),
                    loops=tuple((chain.place, len(chain.links)) for chain in own),
                )
            )
    return systems


def intermediate_faults(
    steps: Sequence[Intermediate], used: Sequence[tuple[Requirement, Formula]], parts: Sequence[Part]
) -> list[Fault]:
    """Quantities that no requirement needs, and those whose numbers would be in two units."""
    faults = []
    for step in steps:
        users = [
            (requirement, formula)
            for requirement, formula in used
            if step in formula.given or any(step in other.inner for other in formula.given)
        ]
        if not users:
            text = f"no requirement depends on {', '.join(step.names)}: use it in a formula, or leave it out"
            faults.append(Fault(step.place, text))
        bases: dict[str, tuple[float, Requirement]] = {}
        for requirement, formula in users:
            named = [part for part in parts if any(piece in formula.names for piece in part.pieces)]
            for kind, factor in base_units(requirement, named).items():
                other = bases.setdefault(kind, (factor, requirement))
                if other[0] != factor:
                    text = (
                        f"is used by {other[1].place} and {requirement.place}, whose formulas count in different "
                        f'units ("{other[1].unit}" and "{requirement.unit}"): give both requirements the same unit'
                    )
                    faults.append(Fault(step.place, text))
    return faults
