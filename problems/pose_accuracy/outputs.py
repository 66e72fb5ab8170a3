"""Outputs of `pose_accuracy`, its parameters other than the manipulator's, and default limits."""

from __future__ import annotations

from ...declarations import Output, Parameter
from ...models.manipulator import declared
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


def _by_index(name: str) -> Output:
    text = f"standard deviation over machines of the {MEANT[name]}, averaged over poses by the index"
    return Output(f"{name}_{UNITS[name]}", UNITS[name], text, low=0.0)


def _at_pose(name: str) -> tuple[Output, ...]:
    unit, of = UNITS[name], f"of the {MEANT[name]} at the pose"
    outputs = (
        Output(f"{name}_pose_{unit}", unit, f"standard deviation over machines {of}", low=0.0),
        Output(f"{name}_pose_quantile_{unit}", unit, f"quantile over machines {of}, at the coverage", low=0.0),
    )
    text = f"machines that keep {name}_limit_{unit} at the pose"
    return outputs if name not in LIMITED else (*outputs, _yield(f"{name}_pose_yield_percent", text))


def _over_ring(name: str) -> tuple[Output, ...]:
    unit, quantile = UNITS[name], f"{name}_ring_quantile_{UNITS[name]}"
    outputs = _sampled(
        Output(
            quantile,
            unit,
            f"quantile over machines, at the coverage, of the {MEANT[name]} at the worst pose of the ring",
            low=0.0,
        )
    )
    text = f"machines that keep {name}_limit_{unit} at every pose of the ring"
    more = _sampled(_yield(f"{name}_ring_yield_percent", text)) if name in LIMITED else ()
    return outputs + more


def _yield(name: str, meaning: str) -> Output:
    return Output(name, "%", meaning, 100.0, larger_is_better=True, low=0.0, high=100.0)


def _sampled(output: Output) -> tuple[Output, Output]:
    """An output and its standard error."""
    error = f"{output.name}_error"
    return output, Output(error, output.unit, "standard error", error_of=output.name)


MACHINES: tuple[Output, ...] = (
    *(output for name in UNITS for output in _at_pose(name)),
    *(output for name in UNITS for output in _over_ring(name)),
    *_sampled(_yield(BOTH, "machines that keep squareness_limit_mrad and yaw_limit_mrad at every pose of the ring")),
)
"""What machines do at a pose, and over the ring."""
OVER_MACHINES = frozenset(output.name for output in MACHINES if not output.error_of)

OUTPUTS: tuple[Output, ...] = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    *(_by_index(name) for name in UNITS),
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
PARAMETERS = (*declared.PARAMETERS, OTHER, POSE, *BOUNDS)

EXPLAINED = {
    output.name: f"{name}_{UNITS[name]}"
    for output in MACHINES
    for name in UNITS
    if output.name in OVER_MACHINES and output.name.startswith(name)
}
"""By output over machines, the output of the index that gives its contributions."""
