"""What a reported allocation means for machines, in words."""

from __future__ import annotations

from collections.abc import Mapping

from .outputs import LIMITED, UNITS

PLACES = {
    "plane": "mean effects over the rectangle of the ring",
    "volume": "mean effects over the ring",
    "rms_plane": "root mean square over the rectangle of the ring",
    "rms_volume": "root mean square over the ring",
    "every_pose": "at the worst pose of the ring",
}


def remarks_of(
    row: Mapping[str, float], index: str, limits: Mapping[str, float], coverage: float, pose: str
) -> tuple[str, ...]:
    """A sentence per limited pose error of one design, given its outputs by name.

    `limits` are the bounds of the yields, `pose` says where the outputs at a pose are.
    """
    return tuple(_remark(name, row, index, limits[name], coverage, pose) for name in LIMITED)


def _remark(name: str, row: Mapping[str, float], index: str, limit: float, coverage: float, pose: str) -> str:
    unit, percent = UNITS[name], f"{100.0 * coverage:.6g} %"
    beyond = 100.0 - row[f"{name}_pose_yield_percent"]
    return (
        f"cheapest point: {name}_{unit} {row[f'{name}_{unit}']:.3g} is a standard deviation over machines "
        f"({PLACES[index]}); {pose} it is {row[f'{name}_pose_{unit}']:.3g} {unit}, where {beyond:.3g} % of machines "
        f"exceed {limit:g} {unit} and {percent} keep {row[f'{name}_pose_quantile_{unit}']:.3g} {unit}; over the whole "
        f"ring {percent} keep {row[f'{name}_ring_quantile_{unit}']:.3g} {unit}, and "
        f"{row[f'{name}_ring_yield_percent']:.3g} % keep {limit:g} {unit}"
    )
