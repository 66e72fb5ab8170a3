"""Effects in the manipulator against exact geometry, closed forms and limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tolevo import registry
from tolevo.models.effects.effect import Effect, Target
from tolevo.models.effects.measurements import Active, predicted, target_of
from tolevo.models.manipulator.effects import lifts
from tolevo.models.manipulator.forward import exact_pose, solve
from tolevo.models.manipulator.geometry import FollowUp, Manipulator, angles, posture
from tolevo.models.manipulator.pose import ManipulatorPose
from tolevo.testing import EffectContract

N = 30
RNG = np.random.default_rng(2)
TABLE = {
    "r_mm": RNG.uniform(310.0, 640.0, N),
    "z_mm": RNG.uniform(100.0, 300.0, N),
    "phi_deg": RNG.uniform(0.0, 360.0, N),
    "payload_kg": RNG.uniform(0.0, 12.0, N),
    "temperature_C": RNG.uniform(12.0, 45.0, N),
}
R, Z, PHI = TABLE["r_mm"] * 1e-3, TABLE["z_mm"] * 1e-3, np.radians(TABLE["phi_deg"])
AZIMUTH = Rotation.from_rotvec(PHI[:, None] * [0.0, 0.0, 1.0])
POSE = np.stack([TABLE["r_mm"], np.zeros(N), TABLE["z_mm"]], axis=1)
NAMES = [
    "joint_zero_offset",
    "arm_length_error",
    "base_tilt",
    "gravity_sag",
    "thermal_growth",
    "drive_eccentricity",
    "joint_clearance",
]


def moved(name: str, values: dict[str, float], **parameters: str) -> tuple[np.ndarray, np.ndarray]:
    """Position error [mm] and rotation vector [mrad], (N, 3)."""
    active = Active(registry.load("effects", name)(), values)
    model = ManipulatorPose(parameters)
    found = predicted(model, "manipulator_pose", TABLE, [active], np.random.default_rng(0))
    columns = np.stack([found[output.name] for output in model.outputs], axis=1)
    return columns[:, :3], columns[:, 3:]


@pytest.mark.parametrize("name", NAMES)
class TestEveryEffectOfTheManipulator(EffectContract):
    rows = N

    @pytest.fixture(autouse=True)
    def _named(self, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(type(self), "effect_type", registry.load("effects", name), False)

    def table(self) -> dict[str, np.ndarray]:
        return TABLE

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        return target_of(ManipulatorPose, "manipulator_pose", table)


def test_manipulator_effects_have_no_place_elsewhere() -> None:
    target = target_of(ManipulatorPose, "manipulator_pose")
    for name in NAMES:
        effect: Effect = registry.load("effects", name)()
        assert effect.applies(target)
        assert not effect.applies(replace(target, changeable=()))


def test_zero_offset_turns_the_drives() -> None:
    """The same as a machine told other angles."""
    zero = np.array([0.3, -0.2, 0.5])
    values = {f"zero_{i + 1}_mrad": zero[i] for i in range(3)}
    told = angles(Manipulator(), R, Z) + zero * 1e-3
    expected = solve(Manipulator(), told, POSE * 1e-3, PHI)
    position, turn = moved("joint_zero_offset", values)
    np.testing.assert_allclose(position, expected.position * 1e3, atol=1e-9)
    np.testing.assert_allclose(turn, expected.orientation * 1e3, atol=1e-9)


def test_arm_length_is_that_of_another_machine() -> None:
    longer = replace(Manipulator(), arm_length=(0.4001, 0.4, 0.2598))
    expected = solve(longer, angles(Manipulator(), R, Z), POSE * 1e-3, PHI)
    values = {"length_1_um": 100.0, "length_2_um": 0.0, "length_3_um": -200.0}
    position, turn = moved("arm_length_error", values)
    np.testing.assert_allclose(position, expected.position * 1e3, atol=1e-9)
    np.testing.assert_allclose(turn, expected.orientation * 1e3, atol=1e-9)


def test_similar_machine_grows_its_pose() -> None:
    """Every length times 1 + a tau, angles of the drives kept: the pose grows alike, unturned."""
    position, turn = moved("thermal_growth", {"expansion_per_K_ppm": 12.0})
    growth = 12e-6 * (TABLE["temperature_C"] - 20.0)
    np.testing.assert_allclose(position, growth[:, None] * POSE, atol=1e-9)
    np.testing.assert_allclose(turn, 0.0, atol=1e-9)


def tilted(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses of a rigid machine on a tilted base, in its local axes."""
    base = Rotation.from_rotvec([x * 1e-3, y * 1e-3, 0.0])
    about = AZIMUTH
    local = about.inv() * base * about
    return local.apply(POSE) - POSE, local.as_rotvec() * 1e3


def test_tilted_base_turns_the_whole_machine() -> None:
    position, turn = moved("base_tilt", {"x_mrad": 2.0, "y_mrad": -3.0})
    expected = tilted(2.0, -3.0)
    np.testing.assert_allclose(position, expected[0], atol=1e-9)
    np.testing.assert_allclose(turn, expected[1], atol=1e-9)


def test_corrected_command_leaves_the_tilt() -> None:
    """With exact parts the platform stands square to the tilted base, its heading apart."""
    position, turn = moved("base_tilt", {"x_mrad": 2.0, "y_mrad": -3.0}, compensation="position")
    assert not position.any()
    base = Rotation.from_rotvec([2e-3, -3e-3, 0.0])
    up = (AZIMUTH * Rotation.from_rotvec(turn * 1e-3)).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(up, np.tile(base.apply([0.0, 0.0, 1.0]), (N, 1)), atol=1e-10)


def heights(told: np.ndarray) -> np.ndarray:
    return solve(Manipulator(), told, POSE * 1e-3, PHI).position[:, 2]


def test_sag_is_compliance_times_static_torque() -> None:
    """Torque by virtual work, with the height's slope by central differences."""
    nominal, h = angles(Manipulator(), R, Z), 1e-6
    weight = 9.80665 * (TABLE["payload_kg"] + 3.0)
    compliance = np.array([0.02, 0.03, 0.05]) * 1e-3
    told = nominal.copy()
    for i in range(3):
        step = np.zeros(3)
        step[i] = h
        torque = -weight * (heights(nominal + step) - heights(nominal - step)) / (2.0 * h)
        told[:, i] += compliance[i] * torque
    expected = solve(Manipulator(), told, POSE * 1e-3, PHI)
    values = {f"compliance_{i}_mrad_per_Nm": c for i, c in ((1, 0.02), (2, 0.03), (3, 0.05))}
    position, turn = moved("gravity_sag", values | {"moving_mass_kg": 3.0})
    np.testing.assert_allclose(position, expected.position * 1e3, atol=1e-6)
    np.testing.assert_allclose(turn, expected.orientation * 1e3, atol=1e-6)
    assert np.all(position[:, 2] < 0.0)  # the platform sinks


def test_eccentric_drive_errs_once_per_turn_of_its_arm() -> None:
    nominal = angles(Manipulator(), R, Z)
    told = nominal.copy()
    told[:, 0] += 1e-3 * (0.4 * np.cos(PHI + nominal[:, 0]) - 0.3 * np.sin(PHI + nominal[:, 0]))
    told[:, 2] += 1e-3 * 0.2 * np.sin(nominal[:, 2])
    expected = solve(Manipulator(), told, POSE * 1e-3, PHI)
    values = {"drive_cos_1_mrad": 0.4, "drive_sin_1_mrad": -0.3, "drive_sin_3_mrad": 0.2}
    position, turn = moved("drive_eccentricity", values)
    np.testing.assert_allclose(position, expected.position * 1e3, atol=1e-9)
    np.testing.assert_allclose(turn, expected.orientation * 1e3, atol=1e-9)


def pulls() -> np.ndarray:
    """Tensions (N, 3 chains, 2 rods) that hold a unit weight on the platform: six equations."""
    chains = posture(Manipulator(), R, Z)
    half = 0.5 * Manipulator().distances[:, None]
    seats = np.stack([chains.p + half * chains.n, chains.p - half * chains.n], axis=2)
    force = -np.broadcast_to(chains.w[:, :, None], seats.shape)
    wrench = np.concatenate([force, np.cross(seats, force)], axis=-1).reshape(N, 6, 6)
    weight = np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (N, 1))
    return np.linalg.solve(wrench.swapaxes(1, 2), -weight[..., None]).reshape(N, 3, 2)


def test_play_of_joints_lies_where_the_rods_are_pulled() -> None:
    """Statics of the platform, written out apart from the model: longer in tension."""
    errors = np.zeros((N, 63))
    for i in range(3):
        errors[:, 21 * i + 12 : 21 * i + 14] = 15e-6 * np.sign(pulls()[:, i])
    expected = solve(Manipulator(), angles(Manipulator(), R, Z), POSE * 1e-3, PHI, errors)
    position, turn = moved("joint_clearance", {"joint_clearance_um": 15.0})
    np.testing.assert_allclose(position, expected.position * 1e3, atol=1e-9)
    np.testing.assert_allclose(turn, expected.orientation * 1e3, atol=1e-9)
    assert np.all(position[:, 2] < 0.0)


@pytest.mark.parametrize("follow_up", ["fixed", "rod"])
def test_height_by_drive_and_rod_is_that_of_finite_differences(follow_up: FollowUp) -> None:
    machine, h = replace(Manipulator(), follow_up=follow_up), 1e-7
    by_drive, by_rod = lifts(machine, R, Z, PHI)
    for chain in range(3):
        for place, expected in ((7, by_drive[:, chain]), (12, by_rod[:, chain, 0]), (13, by_rod[:, chain, 1])):
            errors = np.zeros((2, 63))
            errors[:, 21 * chain + place] = (h, -h)
            ends = exact_pose(machine, R[:, None], Z[:, None], PHI[:, None], errors).position
            slope = (ends[:, 0, 2] - ends[:, 1, 2]) / (2.0 * h)
            np.testing.assert_allclose(expected, slope, rtol=1e-4, atol=1e-5)


def test_changes_per_row_are_those_of_single_rows() -> None:
    model, rng = ManipulatorPose(), np.random.default_rng(0)
    change = {"arm_length_1_um": np.linspace(-50.0, 50.0, N), "growth_ppm": np.linspace(0, 90, N)}
    whole = model.predict(TABLE, rng, change)
    for row in (0, 7, N - 1):
        part = {name: column[row : row + 1] for name, column in TABLE.items()}
        one = model.predict(part, rng, {name: c[row : row + 1] for name, c in change.items()})
        for name, values in one.items():
            assert values[0] == pytest.approx(whole[name][row], abs=1e-9), name
