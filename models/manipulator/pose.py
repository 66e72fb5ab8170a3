"""Declarations of the manipulator's models, by the names of configurations.

Shared by the problem `pose_accuracy` and the model `manipulator_pose`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault, raise_all
from ...section import Array, Output, Parameter, Value
from ...units import MM, MRAD
from ..inputs import Distribution
from ..measurable import NO_CHANGES, Column, MeasurableModel, Outside, Role
from .effects import CHANGEABLE, base_tilt, changed_errors
from .forward import compensated, exact_pose, turn_about_vertical
from .geometry import CHAINS, Manipulator, TaskRing, cross, posture, reach, rotation_vector, turned, vector
from .maps import NAMES, SOURCES, error_vector
from .ring import GRID, INDICES

_ASSUMED = "assumed: the document's Table 1 is lost"
_RING = "document M, section Sensitivity analysis"
INDEX_CHOICES = (*INDICES, "every_pose")
DOTTED = "elementary_errors."


def _length(name: str, default: Value, meaning: str, low: float = 0.0) -> Parameter:
    return Parameter(name, default, "mm", meaning, _ASSUMED, assumed=True, low=low, high=1e6, open_low=low == 0.0)


PARAMETERS: tuple[Parameter, ...] = (
    _length("half_length_mm", 60.0, "platform attachments 1 and 2 from its middle, tangentially"),
    _length("half_width_mm", 45.0, "platform attachment 3 from its middle, radially"),
    _length("hinge_offset_mm", 150.0, "height of chain 3's hinge", low=-1e6),
    _length("arm_length_mm", (400.0, 400.0, 260.0), "lengths of the arms"),
    _length("rod_length_mm", (480.0, 480.0, 420.0), "lengths of the rods"),
    _length("joint_distance_mm", (80.0, 80.0, 100.0), "distances of the joints on a joint line"),
    Parameter("ring_r_mm", (300.0, 650.0), "mm", "radii of the ring", _RING, low=-1e6, high=1e6),
    Parameter(
        "ring_z_mm",
        (100.0, 300.0),
        "mm",
        "heights of the ring (document M: 200 mm in all)",
        "assumed: where the 200 mm begin",
        assumed=True,
        low=-1e6,
        high=1e6,
    ),
    Parameter(
        "index",
        "plane",
        "",
        "mean over the ring: of sizes or rms, by the plane's area or by the ring's volume; or every pose",
        "document M: plane",
        choices=INDEX_CHOICES,
    ),
    Parameter(
        "follow_up",
        "fixed",
        "",
        "follow-up plane of chain 3: at the azimuth commanded (M1), or turned by its rod (M2)",
        "assumed",
        assumed=True,
        choices=("fixed", "rod"),
    ),
)
"""Parameters of both."""

ERRORS = Parameter("elementary_errors", {}, "", "elementary errors by name; omitted errors are 0", choices=NAMES)
COMPENSATION = Parameter(
    "compensation",
    "none",
    "",
    "position: outputs are the residual errors after the command is corrected until the position is exact",
    choices=("none", "position"),
)


def manipulator(parameters: Mapping[str, Value]) -> Manipulator:
    """The machine (SI) of `parameters` by declared name; omitted ones keep their defaults."""
    p = _complete_parameters(parameters)
    return Manipulator(
        half_length=p["half_length_mm"] * MM,
        half_width=p["half_width_mm"] * MM,
        hinge_offset=p["hinge_offset_mm"] * MM,
        arm_length=_metres(p["arm_length_mm"]),
        rod_length=_metres(p["rod_length_mm"]),
        joint_distance=_metres(p["joint_distance_mm"]),
        follow_up=p["follow_up"],
    )


def task_ring(parameters: Mapping[str, Value]) -> TaskRing:
    """The task ring (SI) of `parameters` by declared name."""
    p = _complete_parameters(parameters)
    return TaskRing(_metres(p["ring_r_mm"]), _metres(p["ring_z_mm"]))


def elementary_errors(parameters: Mapping[str, Value]) -> Array:
    """All 63 errors (63,) [m, rad] of the table `elementary_errors`.

    A single error may also be given in `parameters` as `elementary_errors.NAME`, the name that a
    recalibration uses. Raises InputError.
    """
    table: dict[str, Any] = dict(parameters.get(ERRORS.name, {}))  # type: ignore[arg-type]
    table |= {name.removeprefix(DOTTED): value for name, value in parameters.items() if name.startswith(DOTTED)}
    return error_vector(table, "parameters.elementary_errors")


def _complete_parameters(parameters: Mapping[str, Value]) -> dict[str, Any]:
    return {p.name: p.default for p in PARAMETERS} | dict(parameters)


def _metres(lengths: Any) -> Any:
    """A list of millimetres in metres."""
    return tuple((np.asarray(lengths, dtype=float) * MM).tolist())


# Faults of a manipulator's dimensions, or of its task ring.


MAX_CONDITION_NUMBER = 1e3
"""Condition number from which a pose counts as singular: errors grow that much there."""
CHOICES = ("fixed", "rod")


def faults(manipulator: Manipulator, ring: TaskRing, place: str = "parameters") -> list[Fault]:
    """Every fault, at the keys of a configuration (`arm_length_mm`, `ring_r_mm`, ...).

    Wrong lists and lengths first; without these, chains that do not close, poses out of reach and
    singular poses of the ring, each with the pose, the chain and the number that shows it.
    """
    listed = [*_length_faults(manipulator, place), *_ring_faults(ring, place)]
    if listed:
        return listed
    r, z = _poses(manipulator, ring)
    return [*_reach_faults(manipulator, r, z, place)] or [*_singularity_faults(manipulator, r, z, place)]


def _length_faults(manipulator: Manipulator, place: str) -> Iterator[Fault]:
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


def _ring_faults(ring: TaskRing, place: str) -> Iterator[Fault]:
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


def _reach_faults(manipulator: Manipulator, r: Array, z: Array, place: str) -> Iterator[Fault]:
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


def _singularity_faults(manipulator: Manipulator, r: Array, z: Array, place: str) -> Iterator[Fault]:
    """Poses where the equations of the position or of the orientation are linearly dependent.

    The chain is that with the largest component in the dependence.
    """
    for name in _rows(manipulator, r[:1], z[:1]):
        r_here, z_here, crossed = _most_singular_pose(manipulator, r, z, name)
        vectors, size, _ = np.linalg.svd(_rows(manipulator, r_here, z_here)[name])
        condition = size[0, 0] / max(size[0, -1], np.finfo(float).tiny)
        if condition < MAX_CONDITION_NUMBER and not crossed:
            continue
        chain = min(int(np.argmax(np.abs(vectors[0, :, -1]))) + 1, CHAINS)  # its rod is of chain 3
        yield Fault(
            f"{place}.ring_r_mm",
            f"the ring {'crosses' if crossed else 'comes close to'} a singularity of the {name} at"
            f" the pose {_pose(r_here, z_here, 0)}, chain {chain}: condition number"
            f" {condition:.4g} (must be below {MAX_CONDITION_NUMBER:g})",
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


def _most_singular_pose(manipulator: Manipulator, r: Array, z: Array, name: str) -> tuple[Array, Array, bool]:
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


# Pose errors of one manipulator, as measured by a measuring machine.


ACTED_ON = "acts through effects only"
FREE_STEMS = ("drive_zero_", "arm_length_", "rod_length_", "platform_attachment_")


class ManipulatorPose(MeasurableModel):
    """Pose errors of the parallel manipulator with full-circle rotation (document M).

    The exact pose, by Newton's method, of a machine with the elementary errors of
    `[parameters.elementary_errors]`, less the nominal pose, in the axes (e_r, e_t, z) at its
    azimuth. Payload and temperature act through effects only.
    """

    columns = (
        Column("r_mm", "mm", "radius of the pose", role=Role.POSITION),
        Column("z_mm", "mm", "height of the pose", role=Role.POSITION),
        Column("phi_deg", "deg", "azimuth of the pose", role=Role.ANGLE),
        Column("payload_kg", "kg", f"payload; {ACTED_ON}", False, role=Role.PAYLOAD),
        Column("temperature_C", "C", f"temperature; {ACTED_ON}", False, role=Role.TEMPERATURE),
    )
    outputs = (
        Output("dr_mm", "mm", "position error along e_r"),
        Output("dt_mm", "mm", "position error along e_t"),
        Output("dz_mm", "mm", "position error along z"),
        Output("tilt_r_mrad", "mrad", "rotation about e_r"),
        Output("tilt_t_mrad", "mrad", "rotation about e_t"),
        Output("yaw_mrad", "mrad", "rotation about z"),
    )
    parameters = (*PARAMETERS, ERRORS, COMPENSATION)
    changeable = CHANGEABLE
    corrects = ("pose_accuracy",)
    free: ClassVar[Mapping[str, float]] = {
        f"{DOTTED}{source.name}": 0.5 if source.unit == "mrad" else 100.0
        for source in SOURCES
        if source.name.startswith(FREE_STEMS)
    }

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        values = parameters or {}
        self.machine = manipulator(values)
        self.errors = elementary_errors(values)
        self.correct = values.get(COMPENSATION.name) == "position"
        raise_all(faults(self.machine, task_ring(values)))

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        r, z = (np.asarray(table[name], dtype=float) * MM for name in ("r_mm", "z_mm"))
        cosine = reach(self.machine, r, z)
        wrong = np.isfinite(r + z) & ~(np.abs(cosine) <= 1.0).all(axis=-1)
        return {"r_mm": (wrong, "is out of reach at this z_mm")}

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        r, z = np.asarray(table["r_mm"]) * MM, np.asarray(table["z_mm"]) * MM
        phi = np.radians(table["phi_deg"])
        tilt = base_tilt(changes, phi)
        if self.correct:
            position, turn = np.zeros((len(r), 3)), self._residual(r, z, phi, changes, tilt)
        else:
            errors = changed_errors(self.machine, r, z, phi, self.errors, changes)
            pose = exact_pose(self.machine, r, z, phi, errors)
            start = vector(r, 0.0, z)
            position = turned(start + pose.position, tilt) - start
            frame = turned(np.eye(3), pose.orientation[:, None, :])
            turn = rotation_vector(turned(frame, tilt[:, None, :]))
        measurements = np.concatenate([position / MM, turn / MRAD], axis=-1)
        return {output.name: measurements[:, i] for i, output in enumerate(self.outputs)}

    def _residual(self, r: Array, z: Array, phi: Array, changes: Mapping[str, Array], tilt: Array) -> Array:
        """Residual rotation vectors (n, 3) [rad] when the position is made exact.

        On a tilted base that is the pose where the base is upright; the axes are those at phi.
        """
        where = turned(vector(r, 0.0, z), -tilt)
        ahead = np.arctan2(where[:, 1], where[:, 0])
        r, z = np.hypot(where[:, 0], where[:, 1]), where[:, 2]
        errors = changed_errors(self.machine, r, z, phi + ahead, self.errors, changes)
        residual = compensated(self.machine, r, z, phi + ahead, errors)
        axes = turn_about_vertical(turned(np.eye(3), residual[:, None, :]), ahead[:, None])
        # the frame at phi + ahead, turned back to axes that begin at phi
        return rotation_vector(turned(axes, tilt[:, None, :]))
