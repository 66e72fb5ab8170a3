"""Torsional dynamics over analytic meshes, against closed forms and scipy's integrator."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tolevo.errors import InputError
from tolevo.models.rv_reducer import dynamics as cyclic
from tolevo.models.rv_reducer.dynamics import (
    DisplacedMesh,
    FullDynamics,
    NoSteadyState,
    Oscillator,
    Response,
    TabulatedMesh,
    Train,
    mean_square,
    samples_needed,
    spectrum,
    steady_state,
    sweep,
)

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
Errors = Callable[[Array], Array]
K = 371_276.0  # 108 N m/arcmin
RPM = 2.0 * np.pi / 60.0


@dataclass(frozen=True)
class AnalyticMesh:
    """stiffness(angle) * d (1 + hardening d^2) of d = the part of twist - error beyond the gap."""

    samples: int
    error: Errors = np.zeros_like
    stiffness: Errors = np.ones_like
    hardening: float = 0.0
    gap: float = 0.0

    @property
    def angle(self) -> Array:
        return 2.0 * np.pi * np.arange(self.samples) / self.samples

    def at(self, angle: Array, twist: Array) -> tuple[Array, Array]:
        off = twist - self.error(angle)
        beyond = np.sign(off) * np.maximum(np.abs(off) - self.gap, 0.0)
        k = K * self.stiffness(angle)
        slope = k * (1.0 + 3.0 * self.hardening * beyond**2) * (np.abs(off) >= self.gap)
        return k * beyond * (1.0 + self.hardening * beyond**2), slope

    def torque(self, twist: Array) -> tuple[Array, Array]:
        return self.at(self.angle, twist)

    def equilibrium(self, torque: Array) -> Array:
        low, high = (np.full((*np.shape(torque), self.samples), side) for side in (-1.0, 1.0))
        for _ in range(80):
            middle = 0.5 * (low + high)
            short = self.torque(middle)[0] < np.asarray(torque)[..., None]
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return np.asarray(0.5 * (low + high))

    def peak_force(self, twist: Array) -> Array:
        return np.asarray(np.abs(self.torque(twist)[0]).max(axis=-1) / 0.05)

    def resampled(self, samples: int) -> "AnalyticMesh":
        return replace(self, samples=samples)


def waves(**amplitude: float) -> Errors:
    """Sum of cosines, k40=1e-6 for order 40 [rad]."""
    return lambda angle: np.asarray(sum(size * np.cos(int(name[1:]) * angle + 0.3) for name, size in amplitude.items()))


def varying(**amplitude: float) -> Errors:
    wave = waves(**amplitude)
    return lambda angle: 1.0 + wave(angle)


LINEAR = AnalyticMesh(1024, waves(k40=2e-5, k78=1e-5, k80=4e-6))
PARAMETRIC = AnalyticMesh(2048, waves(k39=1e-5, k78=2e-5), varying(k40=0.15), hardening=2e5)
RATTLING = AnalyticMesh(2048, waves(k39=1e-5, k78=2e-5), varying(k40=0.15), gap=3e-5)


def points(mesh: AnalyticMesh, train: Train, torque: float, rpm: float) -> Oscillator:
    return Oscillator.of(mesh, train, np.asarray(torque), np.asarray(rpm * RPM))


def integrated(mesh: AnalyticMesh, train: Train, torque: float, speed: float, c: float) -> Array:
    """Twist over the last turn at 4096 equal steps, both inertias free, by scipy."""
    first = train.reduction_ratio**2 * float(train.input_inertia)
    second = float(train.load_inertia)
    decay = 2.0 * float(train.reduced_inertia) / c
    end = 2.0 * np.pi / speed
    start = -np.ceil(20.0 * decay / end) * end

    def motion(t: float, y: Array) -> list[float]:
        pull = float(mesh.at(np.array(speed * t), y[0] - y[2])[0]) + c * (y[1] - y[3])
        return [y[1], (torque - pull) / first, y[3], (pull - torque) / second]

    times = end * np.arange(4096) / 4096
    found = solve_ivp(motion, (start, end), [torque / K, 0.0, 0.0, 0.0], "DOP853", times,
                      rtol=1e-9, atol=1e-13, max_step=0.1 * end / 80)  # fmt: skip
    return np.asarray(found.y[0] - found.y[2])


@pytest.mark.parametrize(("mesh", "torque", "rpm"), [
    (PARAMETRIC, 412.0, 30.0),
    (PARAMETRIC, 412.0, 42.2),  # order 78 at the resonance
    (RATTLING, 60.0, 30.0),
    (RATTLING.resampled(4096), 10.0, 41.0),  # loses contact and meets the other flank
])  # fmt: skip
def test_steady_state_is_that_of_solve_ivp(mesh: AnalyticMesh, torque: float, rpm: float) -> None:
    train = Train()
    one = points(mesh, train, torque, rpm)
    found = steady_state(mesh, one)
    assert found.residual[0] < 1e-9
    expected = integrated(mesh, train, torque, rpm * RPM, float(one.damping[0]))
    assert np.ptp(found.twist) == pytest.approx(np.ptp(expected), rel=5e-3)
    at_the_samples = expected[:: 4096 // mesh.samples]
    np.testing.assert_allclose(found.twist[0], at_the_samples, atol=5e-3 * np.ptp(expected))


@pytest.mark.parametrize("rpm", [0.3, 5.0, 41.2, 42.2, 82.3, 400.0])
@pytest.mark.parametrize("ratio", [0.02, 0.06])
def test_linear_limit_is_the_closed_form_response(rpm: float, ratio: float) -> None:
    train, speed = Train(damping_ratio=ratio), rpm * RPM
    found = spectrum(steady_state(LINEAR, points(LINEAR, train, 412.0, rpm)).twist[0])
    inertia = float(train.reduced_inertia)
    c = 2.0 * ratio * np.sqrt(K * inertia)
    for order, size in ((40, 2e-5), (78, 1e-5), (80, 4e-6)):
        wave = order * speed
        expected = K / (K - inertia * wave**2 + 1j * c * wave) * size * np.exp(0.3j)
        np.testing.assert_allclose(found.at(order), expected, rtol=1e-6)
    assert found.at(0.0).real == pytest.approx(412.0 / K, rel=1e-9)


def error_at(mesh: AnalyticMesh, samples: int, rpm: float, torque: float) -> float:
    """Largest error of the twist, relative to its amplitude, against 32768 samples."""
    exact = twist_of(mesh, 32768, rpm, torque)[:: 32768 // samples]
    return float(np.abs(twist_of(mesh, samples, rpm, torque) - exact).max() / np.ptp(exact))


@cache
def twist_of(mesh: AnalyticMesh, samples: int, rpm: float, torque: float) -> Array:
    """The steady twist by so many samples; the finest is that of several errors."""
    at = points(mesh.resampled(32768), Train(), torque, rpm)
    return np.asarray(steady_state(mesh.resampled(samples), at).twist[0])


def test_smooth_torque_converges_faster_than_any_power() -> None:
    mesh = AnalyticMesh(64, waves(k3=2e-4), varying(k2=0.4), hardening=2e5)
    errors = [error_at(mesh, n, 1000.0, 412.0) for n in (16, 32, 64)]
    first, second = np.log2(np.array(errors[:-1]) / errors[1:])
    assert second > first + 4.0 > 12.0
    assert errors[2] < 1e-8


def test_contact_that_makes_and_breaks_converges_with_order_two() -> None:
    counts = np.array([512, 1024, 2048, 4096])
    errors = [error_at(RATTLING, n, 41.0, 20.0) for n in counts]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert 1.7 < order < 3.5


@pytest.mark.parametrize("rpm", [0.2, 1.0, 2.1, 5.0, 15.0, 42.0, 60.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_converges_at_every_speed_with_the_mesh_order(rpm: float, direction: float) -> None:
    mesh = AnalyticMesh(4096, waves(k78=5e-6, k1560=2e-6), varying(k40=0.05, k1560=0.05))
    one = points(mesh, Train(), 412.0, direction * rpm)
    fine = mesh.resampled(int(samples_needed(mesh.samples, one)[0]))
    assert steady_state(fine, one).residual[0] < 1e-9


def test_turning_backwards_is_the_mirror_image() -> None:
    """At (-angle) the mesh of even errors is the same, so the twist is that of turning forwards."""
    mesh = AnalyticMesh(512, lambda a: 2e-5 * np.cos(40.0 * a), lambda a: 1.0 + 0.1 * np.cos(a))
    forth, back = (steady_state(mesh, points(mesh, Train(), 100.0, rpm)) for rpm in (50.0, -50.0))
    mirrored = np.roll(back.twist[0][::-1], 1)
    np.testing.assert_allclose(mirrored, forth.twist[0], rtol=1e-9)


@pytest.mark.parametrize("mesh", [PARAMETRIC, RATTLING])
def test_damping_takes_what_the_mesh_gives(mesh: AnalyticMesh) -> None:
    """Over a turn inertia and the constant torque do no work: -integral tau dtheta = c theta'^2."""
    one = points(mesh, Train(), 20.0, 41.0)
    twist = steady_state(mesh, one).twist
    order = np.fft.rfftfreq(mesh.samples, 1.0 / mesh.samples)
    rate = np.fft.irfft(1j * order * one.speed[0] * np.fft.rfft(twist[0]), mesh.samples)
    given = -np.mean(mesh.torque(twist)[0][0] * rate)
    assert given > 0.0
    assert given == pytest.approx(float(one.damping[0]) * np.mean(rate**2), rel=1e-5)


@pytest.mark.parametrize("order", [40, 78, 80])
def test_the_resonance_is_met_by_every_order_at_the_same_frequency(order: int) -> None:
    mesh = AnalyticMesh(1024, waves(**{f"k{order}": 1e-5}))
    train = Train(damping_ratio=0.03)
    mode = float(np.sqrt(K / train.reduced_inertia)) / (2.0 * np.pi)
    assert 50.0 < mode < 60.0
    speed = np.linspace(40.0, 70.0, 301) * 2.0 * np.pi / order
    found = sweep(mesh, train, 412.0, speed)
    peak = speed[np.argmax(found.amplitude)] * order / (2.0 * np.pi)
    assert peak == pytest.approx(mode, rel=5e-3)
    assert found.amplitude.max() == pytest.approx(1e-5 / (2.0 * 0.03), rel=2e-3)


def test_a_sweep_is_its_points_one_by_one() -> None:
    speed, torque = np.array([2.0, 4.4]), np.array([100.0, 412.0])
    train = Train(load_inertia=np.array([4.0, 9.0]))
    together = sweep(PARAMETRIC, train, torque, speed)
    for at in range(2):
        one = replace(train, load_inertia=float(np.asarray(train.load_inertia)[at]))
        alone = sweep(PARAMETRIC, one, torque[at], speed[at])
        assert together.amplitude[at] == pytest.approx(alone.amplitude[0], rel=1e-6)
        assert together.peak_force[at] == pytest.approx(alone.peak_force[0], rel=1e-6)


def test_slow_turning_is_quasi_static() -> None:
    found = sweep(PARAMETRIC, Train(), 412.0, 0.01 * RPM)
    static = PARAMETRIC.equilibrium(np.asarray(412.0))
    assert found.amplitude[0] == pytest.approx(0.5 * np.ptp(static), rel=1e-5)
    assert found.peak_force[0] == pytest.approx(412.0 / 0.05, rel=1e-5)


def test_a_heavier_load_lowers_the_mode_to_that_of_the_input_inertia() -> None:
    train = Train(load_inertia=np.array([4.0, 40.0, 1e9]))
    mode = train.mode(np.asarray(K))
    assert np.all(np.diff(mode) < 0.0)
    assert mode[-1] == pytest.approx(np.sqrt(K / (121.0**2 * 8e-4)), rel=1e-6)


# What is refused, and what is said


@pytest.mark.parametrize(("change", "named"), [
    ({"load_inertia": 0.0}, "load_inertia"),
    ({"input_inertia": 0.0}, "input_inertia"),
    ({"input_inertia": np.nan}, "input_inertia"),
    ({"damping_ratio": 0.0}, "damping_ratio"),
    ({"damping_ratio": 1.0}, "damping_ratio"),
])  # fmt: skip
def test_trains_that_do_not_vibrate(change: dict[str, float], named: str) -> None:
    with pytest.raises(InputError, match=named):
        sweep(LINEAR, replace(Train(), **change), 412.0, 1.0)


@pytest.mark.parametrize("speed", [0.0, -1.0, np.nan, np.inf])
def test_speeds_that_are_no_speeds(speed: float) -> None:
    with pytest.raises(InputError, match="speed"):
        sweep(LINEAR, Train(), 412.0, np.array([1.0, speed]))


def test_a_vibration_that_is_not_periodic_is_reported() -> None:
    """Almost without load, in the resonance, a unit with clearance hammers between its flanks."""
    full = FullDynamics(RATTLING, Train())
    angle, torque = np.zeros(3), np.array([4.0, 60.0, 4.0])
    with pytest.warns(NoSteadyState, match="4 N m and 41 rpm; measurements without a value: 2"):
        found = full.twist(angle, torque, np.full(3, 41.0 * RPM))
    assert np.isnan(found).tolist() == [True, False, True]
    response = sweep(RATTLING, Train(), 4.0, 41.0 * RPM)
    assert np.isnan(response.amplitude[0])
    assert response.residual[0] > 1e-3


def test_full_dynamics_reads_the_steady_state() -> None:
    one = points(PARAMETRIC, Train(), 200.0, 42.0)
    expected = steady_state(PARAMETRIC, one).twist[0]
    full = FullDynamics(PARAMETRIC, Train())
    count = PARAMETRIC.samples
    found = full.twist(PARAMETRIC.angle, np.full(count, 200.0), np.full(count, 42.0 * RPM))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_displaced_input_moves_the_twist() -> None:
    plain = AnalyticMesh(256)
    moved = DisplacedMesh(plain, waves(k40=2e-5)(plain.angle))
    direct = AnalyticMesh(256, waves(k40=2e-5))
    both = [steady_state(m, Oscillator.of(m, Train(), np.asarray(50.0), np.asarray(8.0))).twist
            for m in (moved, direct)]  # fmt: skip
    np.testing.assert_allclose(both[0], both[1], rtol=1e-9)
    assert moved.peak_force(both[0]) == pytest.approx(direct.peak_force(both[1]))
    finer = moved.resampled(512)
    np.testing.assert_allclose(finer.displacement, waves(k40=2e-5)(direct.resampled(512).angle),
                               atol=1e-18)  # fmt: skip


def test_all_faults_at_once() -> None:
    train = Train(load_inertia=0.0, damping_ratio=2.0)
    with pytest.raises(InputError) as caught:
        sweep(LINEAR, train, np.inf, 0.0)
    assert len(caught.value.faults) == 4


def test_torque_beyond_momentary_is_computed() -> None:
    found = sweep(LINEAR, Train(), 2500.0, 1.0)
    assert isinstance(found, Response)
    assert np.isfinite(found.amplitude[0])


# Linear equations and tabulated mesh


def test_cyclic_equations_against_a_dense_matrix() -> None:
    rng = np.random.default_rng(1)
    n, inertia, damping = 24, np.array([0.7, 0.02]), np.array([0.1, -0.03])
    stiffness, right = 1.0 + rng.random((2, n)), rng.normal(size=(2, n))
    found = cyclic.solve(inertia, damping, stiffness, right)
    step = 2.0 * np.pi / n
    for at in range(2):
        dense = np.diag(stiffness[at])
        for offset in range(-2, 3):
            shifted = np.roll(np.eye(n), offset, axis=1)
            dense += shifted * cyclic.SECOND[offset + 2] * inertia[at] / step**2
            dense += shifted * cyclic.FIRST[offset + 2] * damping[at] / step
        np.testing.assert_allclose(found[at], np.linalg.solve(dense, right[at]), rtol=1e-9)


def table(mesh: AnalyticMesh, count: int) -> TabulatedMesh:
    def loads(twist: Array) -> tuple[Array, Array]:
        return mesh.torque(np.broadcast_to(twist, (len(twist), mesh.samples)))

    return TabulatedMesh.of(loads, mesh.peak_force, 2e-5, 5e-3, count)


def test_table_is_the_mesh() -> None:
    found = table(PARAMETRIC, 129)
    twist = np.linspace(-3e-3, 4e-3, 1000)[:, None] * np.ones(PARAMETRIC.samples)
    for one, other in zip(found.torque(twist), PARAMETRIC.torque(twist), strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-3 * np.abs(other).max())
    static = found.equilibrium(np.array([-300.0, 0.5, 412.0]))
    exact = PARAMETRIC.equilibrium(np.array([-300.0, 0.5, 412.0]))
    np.testing.assert_allclose(static, exact, atol=1e-8)
    np.testing.assert_allclose(found.torque(static)[0][2], 412.0, rtol=1e-9)


def test_table_slope_is_the_derivative_of_its_torque() -> None:
    found = table(RATTLING, 65)
    twist = np.random.default_rng(2).uniform(-6e-3, 6e-3, (20, RATTLING.samples))
    rise = (found.torque(twist + 1e-9)[0] - found.torque(twist - 1e-9)[0]) / 2e-9
    np.testing.assert_allclose(found.torque(twist)[1], rise, rtol=1e-3, atol=1e-4 * K)


def test_table_torque_never_falls() -> None:
    found = table(RATTLING, 33)
    twist = np.linspace(-6e-3, 6e-3, 3001)[:, None] * np.ones(RATTLING.samples)
    assert np.all(np.diff(found.torque(twist)[0], axis=0) >= -1e-9)


def test_resampled_table_keeps_the_samples_it_had() -> None:
    found = table(PARAMETRIC, 65)
    fine = found.resampled(2 * found.samples)
    static = fine.equilibrium(np.asarray(412.0))
    assert fine.peak_force(static) == pytest.approx(found.peak_force(static[::2]))
    np.testing.assert_allclose(static[::2], found.equilibrium(np.asarray(412.0)), atol=1e-12)


# Spectrum


def test_orders_of_known_waves() -> None:
    angle = 2.0 * np.pi * np.arange(512) / 512
    reading = 3.0 + 2.0 * np.cos(39 * angle + 0.4) - 0.5 * np.sin(78 * angle)
    found = spectrum(reading)
    assert found.at(0) == pytest.approx(3.0)
    assert found.at(39) == pytest.approx(2.0 * np.exp(0.4j))
    assert found.at(78) == pytest.approx(0.5j)
    others = np.delete(np.abs(found.amplitude), [0, 39, 78])
    assert others.max() < 1e-14


def test_quarter_orders_are_exact_over_four_turns() -> None:
    angle = 2.0 * np.pi * 4.0 * np.arange(2048) / 2048
    found = spectrum(1.5 * np.cos(10.25 * angle - 0.2), turns=4)
    assert found.at(10.25) == pytest.approx(1.5 * np.exp(-0.2j))
    assert np.abs(found.at(10.0)) < 1e-13


def test_a_finer_grid_shows_where_a_wave_stands_and_keeps_the_whole_orders() -> None:
    angle = 2.0 * np.pi * np.arange(1024) / 1024
    reading = np.cos(30.5 * angle) + 0.01 * np.random.default_rng(3).normal(size=1024)
    fine, coarse = spectrum(reading, grid=0.25), spectrum(reading)
    assert fine.order[1] == 0.25
    assert fine.order[np.argmax(np.abs(fine.amplitude))] == 30.5
    np.testing.assert_allclose(fine.amplitude[:-1:4], coarse.amplitude[:-1], atol=1e-13)


def test_parseval() -> None:
    reading = np.random.default_rng(4).normal(size=(3, 256))
    np.testing.assert_allclose(mean_square(spectrum(reading)), np.mean(reading**2, axis=-1))


def test_orders_that_are_not_there() -> None:
    found = spectrum(np.ones(64))
    with pytest.raises(ValueError, match="not on the grid"):
        found.at(0.25)
    with pytest.raises(ValueError, match="does not fit"):
        spectrum(np.ones(64), turns=1, grid=0.3)
