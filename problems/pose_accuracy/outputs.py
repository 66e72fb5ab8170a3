"""Outputs of `pose_accuracy`, its parameters other than the manipulator's, and default limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ...errors import nearest
from ...models.costs import CostCurve, Reciprocal
from ...models.manipulator import pose
from ...models.manipulator.effects import KINDS
from ...models.manipulator.maps import orientation_combinations
from ...section import Kind, Output, Parameter, Section, Variable
from ...units import split_unit
from ..settings import Bound

UNITS = {"squareness": "mrad", "yaw": "mrad", "position": "mm"}
"""The three pose errors."""
LIMITED = ("squareness", "yaw")
"""Those with a yield."""
BOTH = "ring_yield_percent"
"""The yield of both together."""
MEANT = {
    "squareness": "tilt of the platform",
    "yaw": "rotation of the platform about z",
    "position": "position error from these sources through the orientation, and from other_sources",
}
ERRORS = tuple(f"{name}_{unit}" for name, unit in UNITS.items())
"""Standard deviations by the index; the problem has a convex form of these."""


def _index_output(name: str) -> Output:
    text = f"standard deviation over machines of the {MEANT[name]}, averaged over poses by the index"
    return Output(f"{name}_{UNITS[name]}", UNITS[name], text, low=0.0)


def _pose_outputs(name: str) -> tuple[Output, ...]:
    unit, of = UNITS[name], f"of the {MEANT[name]} at the pose"
    outputs = (
        Output(f"{name}_pose_{unit}", unit, f"standard deviation over machines {of}", low=0.0),
        Output(f"{name}_pose_quantile_{unit}", unit, f"quantile over machines {of}, at the coverage", low=0.0),
    )
    text = f"machines that keep {name}_limit_{unit} at the pose"
    return outputs if name not in LIMITED else (*outputs, _yield(f"{name}_pose_yield_percent", text))


def _ring_outputs(name: str) -> tuple[Output, ...]:
    unit, quantile = UNITS[name], f"{name}_ring_quantile_{UNITS[name]}"
    outputs = _sampled_outputs(
        Output(
            quantile,
            unit,
            f"quantile over machines, at the coverage, of the {MEANT[name]} at the worst pose of the ring",
            low=0.0,
        )
    )
    text = f"machines that keep {name}_limit_{unit} at every pose of the ring"
    more = _sampled_outputs(_yield(f"{name}_ring_yield_percent", text)) if name in LIMITED else ()
    return outputs + more


def _yield(name: str, meaning: str) -> Output:
    return Output(name, "%", meaning, 100.0, larger_is_better=True, low=0.0, high=100.0)


def _sampled_outputs(output: Output) -> tuple[Output, Output]:
    """An output and its standard error."""
    error = f"{output.name}_error"
    return output, Output(error, output.unit, "standard error", error_of=output.name)


MACHINES: tuple[Output, ...] = (
    *(output for name in UNITS for output in _pose_outputs(name)),
    *(output for name in UNITS for output in _ring_outputs(name)),
    *_sampled_outputs(
        _yield(BOTH, "machines that keep squareness_limit_mrad and yaw_limit_mrad at every pose of the ring")
    ),
)
"""What machines do at a pose, and over the ring."""
OVER_MACHINES = frozenset(output.name for output in MACHINES if not output.error_of)

OUTPUTS: tuple[Output, ...] = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    *(_index_output(name) for name in UNITS),
    *MACHINES,
)

LIMITS = {"squareness_mrad": Bound(high=0.2), "yaw_mrad": Bound(high=0.2)}
"""Assumed: the limits of the standard that the document cites are not at hand."""

OTHER = Parameter(
    "other_sources_mm",
    0.0,
    "mm",
    "standard deviation of the position from other sources, the same along all axes and at every pose",
    "assumed: none",
    assumed=True,
    low=0.0,
)
POSE = Parameter(
    "pose",
    {},
    "",
    "pose of the outputs `..._pose_...`; empty: the worst of the ring for each",
    choices=("r_mm", "z_mm"),
)
_SAME = "assumed: the number by which the document's task limits the standard deviation here"
BOUNDS = tuple(
    Parameter(
        f"{name}_limit_{UNITS[name]}",
        0.2,
        UNITS[name],
        f"bound of the {MEANT[name]} of a machine that its yields are of",
        _SAME,
        assumed=True,
        low=0.0,
        open_low=True,
    )
    for name in LIMITED
)
PARAMETERS = (*pose.PARAMETERS, OTHER, POSE, *BOUNDS)

EXPLAINED = {
    output.name: f"{name}_{UNITS[name]}"
    for output in MACHINES
    for name in UNITS
    if output.name in OVER_MACHINES and output.name.startswith(name)
}
"""By output over machines, the output of the index that gives its contributions."""


# Groups of orientation sources that share a tolerance: the document's nine, or the user's.


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


def _sources_of_kind(kind: str) -> tuple[str, ...]:
    stem, _, chain = kind.rpartition("_")
    named = (f"{stem}_arm_{chain}_", f"{stem}_platform_{chain}_")
    return tuple(source for source in SOURCES if source == kind or source.startswith(named))


NINE: Grouping = {f"{kind}_{unit_of(kind)}": _sources_of_kind(kind) for kind in KINDS}
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
        for source, text in _source_faults(name, sources, owner, known, unit, called):
            section.fault(name, text)
            owner.setdefault(source, name)
            sound = False
        grouping[name] = tuple(sources)
    missing = [source for source in known if source not in owner]
    if missing and sound:
        top.fault("grouping", f"leaves out {', '.join(missing)}: every source needs a tolerance")
    return grouping if sound and not missing else None


def _source_faults(
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
