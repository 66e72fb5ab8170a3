"""Faults of a manipulator's dimensions, or of its task ring."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np

from ...arrays import Array
from ...errors import Fault
from ...units import MM
from .geometry import Manipulator, TaskRing
from .indices import GRID
from .inverse import CHAINS, posture, reach
from .vectors import cross

WORST_CONDITION = 1e3
"""Condition number from which a pose counts as singular: errors grow that much there."""
CHOICES = ("fixed", "rod")


def faults(manipulator: Manipulator, ring: TaskRing, place: str = "parameters") -> list[Fault]:
    """Every fault, at the keys of a configuration (`arm_length_mm`, `ring_r_mm`, ...).

    Wrong lists and lengths first; without these, chains that do not close, poses out of reach and
    singular poses of the ring, each with the pose, the chain and the number that shows it.
    """
    listed = [*_of_lengths(manipulator, place), *_of_ring(ring, place)]
    if listed:
        return listed
    r, z = _poses(manipulator, ring)
    return [*_of_reach(manipulator, r, z, place)] or [*_of_singularities(manipulator, r, z, place)]


def _of_lengths(manipulator: Manipulator, place: str) -> Iterator[Fault]:
    for field in fields(manipulator):
        value, key = getattr(manipulator, field.name), f"{place}.{field.name}_mm"
        if field.name == "follow_up":
            if value not in CHOICES:
                yield Fault(f"{place}.follow_up", f'must be "fixed" or "rod", got "{value}"')
        elif field.name == "hinge_offset":
            if not np.isfinite(value):
                yield Fault(key, f"must be finite, got {value}")
        elif np.ndim(value) and len(value) != CHAINS:
            yield Fault(key, f"must hold {CHAINS} numbers, one per chain, got {len(value)}")
        elif not np.all((np.asarray(value) > 0.0) & np.isfinite(value)):
            yield Fault(key, f"must be above 0, got {_millimetres(value)}")


def _of_ring(ring: TaskRing, place: str) -> Iterator[Fault]:
    for name, lowest in (("r", 0.0), ("z", -np.inf)):
        ends, key = getattr(ring, name), f"{place}.ring_{name}_mm"
        if len(ends) != 2:
            yield Fault(key, f"must hold 2 numbers, the low and the high end, got {len(ends)}")
            continue
        if not np.isfinite(ends).all() or not ends[0] < ends[1]:
            yield Fault(key, f"must be [low, high] with low below high, got {_millimetres(ends)}")
        elif not ends[0] > lowest:
            yield Fault(key, f"must be above 0: a ring has a hole, got {_millimetres(ends)}")


def _poses(manipulator: Manipulator, ring: TaskRing) -> tuple[Array, Array]:
    """Poses r, z (n,) that include the ring's edges and the extremes of the chains' distances."""
    r = np.append(np.linspace(*ring.r, GRID), np.clip(manipulator.half_width, *ring.r))
    z = np.append(np.linspace(*ring.z, GRID), np.clip([0.0, manipulator.hinge_offset], *ring.z))
    r, z = np.meshgrid(np.sort(r), np.sort(z), indexing="ij")
    return r.ravel(), z.ravel()


def _of_reach(manipulator: Manipulator, r: Array, z: Array, place: str) -> Iterator[Fault]:
    cosine = reach(manipulator, r, z)
    cosine = np.where(np.isnan(cosine), np.inf, cosine)
    over = np.abs(cosine) - 1.0
    for chain in range(CHAINS):
        worst = int(np.argmax(over[:, chain]))
        lengths = (
            f"its arm of {manipulator.arm_length[chain] / MM:.6g} mm and its rods of"
            f" {manipulator.rod_length[chain] / MM:.6g} mm"
        )
        if over[:, chain].min() > 0.0:
            yield Fault(
                f"{place}.rod_length_mm[{chain}]",
                f"chain {chain + 1} cannot close at any pose of the ring with {lengths}",
            )
        elif over[worst, chain] > 0.0:
            far = "too far away" if cosine[worst, chain] > 0.0 else "too near"
            yield Fault(
                f"{place}.ring_r_mm", f"the pose {_pose(r, z, worst)} is {far} for chain {chain + 1} with {lengths}"
            )


def _of_singularities(manipulator: Manipulator, r: Array, z: Array, place: str) -> Iterator[Fault]:
    """Poses where the equations of the position or of the orientation are linearly dependent.

    The chain is that with the largest component in the dependence.
    """
    for name in _rows(manipulator, r[:1], z[:1]):
        r_here, z_here, crossed = _worst(manipulator, r, z, name)
        vectors, size, _ = np.linalg.svd(_rows(manipulator, r_here, z_here)[name])
        condition = size[0, 0] / max(size[0, -1], np.finfo(float).tiny)
        if condition < WORST_CONDITION and not crossed:
            continue
        chain = min(int(np.argmax(np.abs(vectors[0, :, -1]))) + 1, CHAINS)  # its rod is of chain 3
        yield Fault(
            f"{place}.ring_r_mm",
            f"the ring {'crosses' if crossed else 'comes close to'} a singularity of the {name} at"
            f" the pose {_pose(r_here, z_here, 0)}, chain {chain}: condition number"
            f" {condition:.4g} (must be below {WORST_CONDITION:g})",
        )


def _rows(manipulator: Manipulator, r: Array, z: Array) -> dict[str, Array]:
    """Rows (n, m, m) of the equations of the position, of the orientation, and of the whole.

    The whole is that of model M2: the follow-up rod is the position's fourth equation,
    dP_t - r dpsi, with r dpsi the unknown.
    """
    chains = posture(manipulator, r, z)
    equations = {"position": chains.w, "orientation": cross(chains.n, chains.w)}
    if manipulator.follow_up == "rod":
        rows = np.zeros((len(r), CHAINS + 1, CHAINS + 1))
        rows[:, :CHAINS, :CHAINS] = chains.w
        rows[:, :CHAINS, CHAINS] = cross(chains.p, chains.w)[..., 2] / r[:, None]
        rows[:, CHAINS, 1], rows[:, CHAINS, CHAINS] = 1.0, -1.0
        equations["position with the follow-up rod"] = rows
    return equations


def _worst(manipulator: Manipulator, r: Array, z: Array, name: str) -> tuple[Array, Array, bool]:
    """The pose nearest to a singularity, r, z (1,), and whether the ring crosses it there.

    Where the determinant changes its sign, by bisection between its two extremes.
    """
    rows = _rows(manipulator, r, z)[name]
    side = np.linalg.det(rows)
    low, high = int(np.argmin(side)), int(np.argmax(side))
    if not side[low] < 0.0 < side[high]:
        worst = int(np.argmax(np.linalg.cond(rows)))
        return r[worst : worst + 1], z[worst : worst + 1], False
    ends = np.array([[r[low], z[low]], [r[high], z[high]]])
    for _ in range(60):
        middle = ends.mean(axis=0)
        sign = np.linalg.det(_rows(manipulator, middle[:1], middle[1:])[name])[0]
        ends[int(sign > 0.0)] = middle
    return ends[:1, 0], ends[:1, 1], True


def _pose(r: Array, z: Array, at: int) -> str:
    return f"r = {r[at] / MM:.6g} mm, z = {z[at] / MM:.6g} mm"


def _millimetres(value: float | tuple[float, ...]) -> str:
    """Metres as the millimetres of a configuration."""
    numbers = [f"{number / MM:.10g}" for number in np.atleast_1d(value)]
    return f"[{', '.join(numbers)}]" if np.ndim(value) else numbers[0]
