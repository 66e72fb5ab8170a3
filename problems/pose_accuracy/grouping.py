"""Groups of orientation sources that share a tolerance: the document's nine, or the user's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ...declarations import Kind, Variable
from ...errors import nearest
from ...models.costs import CostCurve, Reciprocal
from ...models.manipulator.effects import KINDS
from ...models.manipulator.sources import orientation_combinations
from ...section import Section
from ...units import split_unit

Grouping = Mapping[str, tuple[str, ...]]
"""Names of the sources (`orientation_combinations`) by design variable."""
SOURCES = tuple(orientation_combinations())
REFERENCE = {"rod_length": 10.0, "joint_distance": 20.0, "joint_line": 0.1}
"""Standard deviation [um, um, mrad] of relative cost 1, by what a source is."""
RANGE = (0.1, 4.0)
"""Search range in units of the reference."""


def _stem(source: str) -> str:
    return next(stem for stem in REFERENCE if source.startswith(stem))


def unit_of(source: str) -> str:
    """Unit of a source's standard deviation."""
    return "mrad" if _stem(source) == "joint_line" else "um"


def reference_of(source: str) -> float:
    """Standard deviation of relative cost 1, in the source's unit."""
    return REFERENCE[_stem(source)]


def _of_kind(kind: str) -> tuple[str, ...]:
    stem, _, chain = kind.rpartition("_")
    named = (f"{stem}_arm_{chain}_", f"{stem}_platform_{chain}_")
    return tuple(source for source in SOURCES if source == kind or source.startswith(named))


NINE: Grouping = {f"{kind}_{unit_of(kind)}": _of_kind(kind) for kind in KINDS}
"""The document's count, in its preferred interpretation: three kinds for each of three chains."""


def read_grouping(
    top: Section, default: Grouping = NINE, unit: Callable[[str], str] = unit_of, called: str = "an orientation source"
) -> Grouping | None:
    """`[grouping]`: design variable = list of sources; the `default` one where there is none.

    None after a fault: every source of the default belongs to exactly one variable, of its own
    unit. `called` is what one of them is.
    """
    if "grouping" not in top:
        return default
    known = tuple(source for sources in default.values() for source in sources)
    section = top.section("grouping")
    table = top.take("grouping")
    grouping: dict[str, tuple[str, ...]] = {}
    owner: dict[str, str] = {}
    sound = True
    for name in table if isinstance(table, dict) else ():
        sources = section.names(name)
        if sources is None:
            sound = False
            continue
        for source, text in _wrong(name, sources, owner, known, unit, called):
            section.fault(name, text)
            owner.setdefault(source, name)
            sound = False
        grouping[name] = tuple(sources)
    missing = [source for source in known if source not in owner]
    if missing and sound:
        top.fault("grouping", f"leaves out {', '.join(missing)}: every source needs a tolerance")
    return grouping if sound and not missing else None


def _wrong(
    name: str, sources: list[str], owner: dict[str, str], known: Sequence[str], unit: Callable[[str], str], called: str
) -> list[tuple[str, str]]:
    """Unknown sources, sources named twice, and wrong units, with texts; records each owner."""
    faults = []
    for source in sources:
        if source not in known:
            text = f'"{source}" is not {called}{nearest(source, known)}'
        elif source in owner:
            text = f'"{source}" already belongs to {owner[source]}'
        elif split_unit(name)[1] != unit(source):
            text = f"the name must end with _{unit(source)}, the unit of {source}"
        else:
            owner[source] = name
            continue
        faults.append((source, text))
    return faults


def variables_of(grouping: Grouping) -> tuple[Variable, ...]:
    """The design variables: a standard deviation per group."""
    return tuple(
        standard_deviation(name, unit_of(sources[0]), reference_of(sources[0]), _meaning(sources))
        for name, sources in grouping.items()
    )


def _meaning(sources: Sequence[str]) -> str:
    if len(sources) > 1:
        return f"each of {', '.join(sources)}"
    return "the relative " + ("rod length dl2_a - dl2_b" if "rod" in sources[0] else "joint distance ddB - ddA")


def standard_deviation(name: str, unit: str, reference: float, of: str) -> Variable:
    """The standard deviation of errors as a design variable; `reference` has the relative cost 1."""
    low, high = (reference * factor for factor in RANGE)
    meaning = f"standard deviation of {of}"
    return Variable(name, unit, Kind.STANDARD_DEVIATION, low, high, meaning, valid_low=1e-9)


def costs_of(grouping: Grouping, reference: Callable[[str], float] = reference_of) -> dict[str, CostCurve]:
    """Relative costs reference/sigma by the `reference` of a source; all of them assumptions."""
    return {name: Reciprocal(0.0, reference(sources[0])) for name, sources in grouping.items()}
