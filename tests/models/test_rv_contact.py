"""Loaded contact of the cycloid stage: the figures of the physics notes, sections 2 to 5."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import brentq

from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact, OverloadWarning, turn_angles
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from tolevo.models.rv_reducer.cycloid import EccentricityLaw, coefficients
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
ARCSEC = ARCMIN / 60.0
PERFECT = PartErrors()
UNIT = LoadedContact()
RIGID = replace(UNIT, series_stiffness=np.inf)
RATIO = UNIT.geometry.output_ratio
LEVER = UNIT.geometry.nominal.lever
PITCH = 2.0 * np.pi / 40.0 * np.arange(200) / 200  # a pin pitch of the crank angle
CRANK = 2.0 * np.pi * np.arange(400) / 400
TURN = turn_angles(39 * 80)


def one_disc(k_n: float = 2e5, modified: bool = True) -> LoadedContact:
    """The convention of section 4's table: one disc, rigidly held, with 0.55 T on its mesh.

    Its lever arms are those of the unmodified profile.
    """
    geometry = ContactGeometry(discs=1, true_levers=False)
    geometry = geometry if modified else replace(geometry, dr_rp=0.0, dr_p=0.0)
    return LoadedContact(geometry, normal_stiffness=k_n * 1e3, series_stiffness=np.inf)


def amplitudes(rotation: Array) -> Array:
    """Amplitude by order per output turn [arcsec] of a rotation over one output turn."""
    return np.asarray(2.0 * np.abs(np.fft.rfft(rotation[0])) / rotation.shape[1] / ARCSEC)


def one_pin(error: float, discs: int) -> Array:
    """An error of the first pin, on the first disc or (discs = 1) over the full length."""
    found = np.zeros((1, discs, 40))
    found[0, 0, 0] = error
    return found


@pytest.mark.parametrize(
    ("torque", "k_n", "most", "mean", "loaded", "wind_up"),
    [
        (412.0, 2e5, 1315.0, 1278.0, 5.40, 0.492),
        (412.0, 6e5, 1852.0, 1804.0, 3.74, 0.262),
        (21.0, 2e5, 199.0, 159.0, 2.09, 0.112),
    ],
)
def test_table_of_section_4(torque: float, k_n: float, most: float, mean: float, loaded: float, wind_up: float) -> None:
    found = one_disc(k_n).equilibrium(PERFECT, PITCH, 0.55 * torque * RATIO)
    peak = found.pin_forces.max(axis=(0, 2, 3))
    np.testing.assert_allclose(peak.max(), most, atol=1.0)
    np.testing.assert_allclose(peak.mean(), mean, atol=1.0)
    np.testing.assert_allclose(found.loaded.mean(), loaded, atol=0.006)
    np.testing.assert_allclose(found.rotation.mean() * RATIO / ARCMIN, wind_up, atol=6e-4)


def turned_gap(phi: Array, turn: float) -> Array:
    """Gap [m] of pins at profile angle phi, the disc really turned forward; of its own."""
    u, r_p, e = phi / 39, 64e-3, 1.3e-3
    centre = (r_p * np.exp(1j * u) - e * np.exp(40j * u)) * np.exp(1j * turn)
    away = first = centre
    for _ in range(40):
        big, small = (r_p - 70e-6) * np.exp(1j * u), e * np.exp(40j * u)
        away, first = centre - (big - small), 1j * (big - 40 * small)
        slope = (away * (1600 * small - big).conj()).real - abs(first) ** 2
        u = u - (away * first.conj()).real / slope
    distance = (away * (-1j * first / abs(first)).conj()).real
    return np.asarray(distance - 40e-6, dtype=np.float64)


def really_turned(psi: float, torque: float, k_n: float) -> tuple[float, float]:
    """Peak pin force [N] and turn [rad] of one disc in balance, gaps not closed linearly."""
    phi = np.angle(np.exp(1j * (psi - 2.0 * np.pi * np.arange(40) / 40)))
    phi = phi[abs(phi) > np.radians(10.0)]  # no pin bears nearer to the bottom of a space

    def left(turn: float) -> float:
        closing = (turned_gap(phi, turn - 1e-7) - turned_gap(phi, turn + 1e-7)) / 2e-7
        return float(np.sum(k_n * np.maximum(0.0, -turned_gap(phi, turn)) * closing) - torque)

    turn = float(brentq(left, 0.0, 1e-3, xtol=1e-13))
    return k_n * float(np.max(-turned_gap(phi, turn))), turn


@pytest.mark.parametrize(("torque", "k_n"), [(412.0, 2e8), (412.0, 6e8), (21.0, 2e8)])
def test_balance_is_that_of_a_profile_really_turned(torque: float, k_n: float) -> None:
    """Gaps close linearly in the model: 0.02 % of the wind-up, 0.1 % of the mean peak force."""
    geometry = ContactGeometry(discs=1)
    contact = LoadedContact(geometry, normal_stiffness=k_n, series_stiffness=np.inf)
    found = contact.equilibrium(PERFECT, PITCH[::20], 0.55 * torque * RATIO)
    wanted = np.array([really_turned(psi, 0.55 * torque, k_n) for psi in PITCH[::20]])
    peak = found.pin_forces.max(axis=(0, 2, 3))
    np.testing.assert_allclose(peak.mean(), wanted[:, 0].mean(), rtol=1e-3)
    np.testing.assert_allclose(peak, wanted[:, 0], rtol=0.015)
    np.testing.assert_allclose(found.rotation[0] * RATIO, wanted[:, 1], rtol=1e-3)
    np.testing.assert_allclose(found.rotation.mean() * RATIO, wanted[:, 1].mean(), rtol=2e-4)


def test_peak_force_of_the_unmodified_profile_is_the_closed_form() -> None:
    found = one_disc(modified=False).equilibrium(PERFECT, PITCH, 0.55 * 412.0 * RATIO)
    nominal = ContactGeometry().nominal
    closed = 4.0 * 0.55 * 412.0 / (nominal.k1 * 39 * nominal.pin_circle_radius)
    assert round(closed) == 447
    # the closed form takes the mean over a pitch for the sum over pins
    np.testing.assert_allclose(found.pin_forces.max(), closed, rtol=2e-3)


def test_no_load_backlash_of_section_4() -> None:
    found = performance.backlash(one_disc(), PERFECT, PITCH) * RATIO / ARCMIN
    np.testing.assert_allclose([found.min(), found.max()], [0.111, 0.121], atol=5e-4)
    np.testing.assert_allclose(found.mean(), 0.1156, atol=5e-5)


def test_stiffness_of_the_mesh_alone_of_section_4() -> None:
    """434 and 1456 N m/arcmin against the mesh, under 12 and 412 N m at the carrier.

    Of the lever arms of the unmodified profile.
    """
    mesh = replace(RIGID, geometry=ContactGeometry(true_levers=False)).mesh(PERFECT, PITCH)
    found = [1.0 / np.mean(1.0 / mesh.torque(mesh.rotation(torque))[1]) / RATIO**2 * ARCMIN for torque in (12.0, 412.0)]
    np.testing.assert_allclose(found, [434.0, 1456.0], rtol=4e-3)


def test_unit_of_the_catalogue() -> None:
    """Rigidity 105..130 N m/arcmin and lost motion 0.36..0.41' of measured units (section 5)."""
    torques = np.array([0.03, 1.0]) * UNIT.rated_torque
    rigidity = np.diff(torques) / np.diff(performance.torque_twist(UNIT, PERFECT, CRANK, torques))[0] * ARCMIN
    lost = performance.lost_motion(UNIT, PERFECT, CRANK) / ARCMIN
    assert 105.0 < rigidity[0] < 130.0
    assert 0.36 < lost[0] < 0.41


def test_stiffness_is_progressive() -> None:
    soft, stiff = (performance.loading(RIGID, PERFECT, PITCH, t).stiffness for t in (1.0, 412.0))
    assert stiff[0] > 4.0 * soft[0]


def test_loading_is_that_of_the_equilibrium() -> None:
    found = performance.loading(UNIT, PERFECT, PITCH, 412.0)
    balance = UNIT.equilibrium(PERFECT, PITCH, 412.0)
    peak = balance.pin_forces.max(axis=(0, 2, 3))
    np.testing.assert_allclose([found.peak[0], found.mean_peak[0]], [peak.max(), peak.mean()])
    np.testing.assert_allclose(found.loaded[0], balance.loaded.mean())


# Section 5: amplitudes of the turn against the mesh (b'), 1/0.967 of those of the carrier.


def test_perfect_unit_shows_the_cycloid_mesh_only() -> None:
    found = UNIT.rotation(PERFECT, PITCH, 412.0)
    np.testing.assert_allclose(0.5 * np.ptp(found) / ARCSEC, 0.4, atol=0.05)
    orders = amplitudes(UNIT.rotation(PERFECT, turn_angles(39 * 320), 412.0))
    orders[1560::1560] = 0.0  # order 1560, 3120, ...
    assert orders[1:].max() < 1e-6


@pytest.mark.parametrize("torque", [21.0, 412.0])
def test_pin_on_one_disc_is_order_39_and_full_length_order_78(torque: float) -> None:
    single, full = (
        amplitudes(UNIT.rotation(PartErrors(pin_radius=one_pin(3e-6, discs)), TURN, torque)) for discs in (2, 1)
    )
    assert single[39] > 0.3
    assert full[39] < 1e-9
    assert full[78] > 0.5


def test_full_length_pin_of_section_5() -> None:
    """3 um: 1.5" at 21 N m, 0.6" at 412, discs rigid on the carrier."""
    errors = PartErrors(pin_radius=one_pin(3e-6, 1))
    found = [amplitudes(RIGID.rotation(errors, TURN, t * RATIO))[78] * RATIO for t in (21.0, 412.0)]
    np.testing.assert_allclose(found, [1.5, 0.6], atol=0.05)


def test_pin_circle_runout_of_section_5() -> None:
    """5 um: 8.3", 1.6" and 2.3" at 0, 21 and 412 N m; found 8.33", 1.42" and 2.45"."""
    errors = PartErrors(circle_offset=np.array([5e-6]))
    _, forward = RIGID.mesh(errors, TURN).touch()
    np.testing.assert_allclose(amplitudes(forward)[78] * RATIO, 8.3, atol=0.05)
    found = [amplitudes(RIGID.rotation(errors, TURN, t * RATIO))[78] * RATIO for t in (21.0, 412.0)]
    np.testing.assert_allclose(found, [1.6, 2.3], rtol=0.15)


def test_runout_of_the_pin_circle_nearly_vanishes_on_springs() -> None:
    """With the series stiffness the discs share the runout: 0.27" instead of 2.45" at 412 N m."""
    errors = PartErrors(circle_offset=np.array([5e-6]))
    found = amplitudes(UNIT.rotation(errors, TURN, 412.0))
    assert 0.2 < found[78] * RATIO < 0.3
    assert found[39] < 1e-9


def phase_error(whole: bool) -> PartErrors:
    found = np.zeros((1, 2, 1 if whole else 2))
    found[0, 0, 0] = 1e-3
    return PartErrors(crank_phase=found)


def test_phase_of_one_eccentric_of_section_5_is_order_40() -> None:
    """1 mrad: 1.86" at 412 N m, which is half of e delta/(2 a_0)."""
    found = amplitudes(UNIT.rotation(phase_error(whole=False), TURN, 412.0)) * RATIO
    np.testing.assert_allclose(found[40], 1.86, atol=0.005)
    np.testing.assert_allclose(found[40], 0.5 * 1.3 / 72.0 * 1e-3 / ARCSEC, rtol=2e-3)
    assert found[39] < 1e-3


def test_phase_of_a_whole_crank_of_section_5_is_order_80() -> None:
    """1 mrad: 1.58" without load, 0.06" at 412 N m, discs rigid on the carrier."""
    mesh = RIGID.mesh(phase_error(whole=True), TURN)
    found = [amplitudes(one) * RATIO for one in (mesh.touch()[1], mesh.rotation(412.0 * RATIO))]
    np.testing.assert_allclose([one[80] for one in found], [1.58, 0.06], atol=0.005)
    assert max(one[40] for one in found) < 1e-4


def test_flank_error_of_section_5() -> None:
    """1 um of normal flank error on both discs is 3.93" at the output."""
    thinner = PartErrors(equidistance=np.full((1, 2), 1e-6))
    (_, moved), (_, still) = (RIGID.mesh(one, CRANK).touch() for one in (thinner, PERFECT))
    found = np.mean(moved - still) / ARCSEC
    np.testing.assert_allclose(found, 3.93, rtol=3e-3)
    np.testing.assert_allclose(1e-6 / LEVER / RATIO / ARCSEC, 3.93, atol=0.005)


def test_flank_error_on_one_disc_moves_half_under_load() -> None:
    """Half of 3.93", less what the softening contact keeps, by the series stiffness."""
    thinner = PartErrors(equidistance=np.array([[1e-6, 0.0]]))
    moved, still = (UNIT.rotation(one, CRANK, 412.0) for one in (thinner, PERFECT))
    np.testing.assert_allclose(np.mean(moved - still) / ARCSEC, 0.5 * 3.93, rtol=0.25)


def test_phase_of_an_eccentric_per_disc_of_section_5() -> None:
    """e delta/(2 a_0) cos(40 psi/39): 3.60" per mrad at the output."""
    turn = UNIT.mesh(phase_error(whole=False), TURN).gaps.turn / RATIO / ARCSEC
    wanted = -3.60 * np.cos(TURN * 40.0 / 39.0)
    np.testing.assert_allclose(turn[0, :, 0], wanted, atol=0.005)
    np.testing.assert_allclose(turn[0, :, 1], 0.0, atol=1e-15)


def test_levers_of_the_modified_profile_take_less_than_a_percent_off() -> None:
    nominal = replace(UNIT, geometry=ContactGeometry(true_levers=False))
    ours, theirs = (performance.loading(one, PERFECT, PITCH, 412.0).mean_peak for one in (UNIT, nominal))
    np.testing.assert_allclose(ours / theirs, 0.993, atol=0.002)


# The linear model of section 2 is the small-error average of this one.


def sensitivity(contact: LoadedContact, angles: Array, **errors: Array) -> float:
    """Change of mean backlash against the mesh, times e z_c, per micrometre of 0.1 um of error."""
    small = {name: 1e-7 * value for name, value in errors.items()}
    moved, still = (performance.backlash(contact, one, angles).mean() for one in (PartErrors(**small), PERFECT))
    return float((moved - still) * RATIO * LEVER / 1e-7)


@pytest.mark.parametrize("contact", [one_disc(), UNIT], ids=["one disc", "two discs"])
@pytest.mark.parametrize(
    ("name", "errors"),
    [
        ("pin_circle_radius", {"circle_radius": np.ones(1)}),
        ("pin_hole_radius", {"hole_radius": np.ones((1, 1, 1))}),
        ("pin_radius", {"pin_radius": np.ones((1, 1, 1))}),
        ("equidistance", {"equidistance": np.ones((1, 1))}),
        ("shift", {"shift": np.ones((1, 1))}),
    ],
)
def test_linear_backlash_is_the_small_error_average(
    contact: LoadedContact, name: str, errors: dict[str, Array]
) -> None:
    wanted = coefficients(contact.geometry.nominal)[name]
    # second order in the modification (0.07 mm on 3 mm of pin) leaves 0.5 %
    np.testing.assert_allclose(sensitivity(contact, CRANK, **errors), wanted, rtol=5e-3)


def test_pitch_and_runout_of_a_disc_change_backlash_along_the_turn_but_not_on_average() -> None:
    """Document B lets them add k1 and 0.5 to backlash: both are bounds, none is an average."""
    angles = turn_angles(39 * 160)
    for errors in (PartErrors(pitch=np.array([[2e-6]])), PartErrors(disc_offset=np.array([[1e-6]]))):
        moved, still = (
            performance.backlash(one_disc(), one, angles) * RATIO * LEVER / 2e-6 for one in (errors, PERFECT)
        )
        np.testing.assert_allclose((moved - still).mean(), 0.0, atol=5e-3)
        assert np.max(moved - still) < 0.8125


def test_stagger_closes_twice_the_turn_of_each_disc() -> None:
    """Discs turned by +s and -s close 2 s; document B's 4 delta' is that of s = 2 delta'."""
    turned = PartErrors(angle=np.array([[1e-6, -1e-6]]))
    moved, still = (performance.backlash(UNIT, one, CRANK) for one in (turned, PERFECT))
    np.testing.assert_allclose((moved - still) * RATIO, -2e-6, rtol=1e-6)


@pytest.mark.parametrize("error", [-10e-6, -5e-6, 5e-6, 10e-6])
def test_eccentricity_law_holds_with_half_its_unit(error: float) -> None:
    """-0.055 d - 12.6 d^2 is in units of 1/(e z_c), 67.8' per mm, and not of 2/(e z_c)."""
    moved, still = (
        performance.backlash(replace(UNIT, exact=True), one, PITCH).mean() * RATIO
        for one in (PartErrors(eccentricity=np.full((1, 1, 1), error)), PERFECT)
    )
    law = EccentricityLaw()
    wanted = (law.linear * error + law.quadratic * error**2) / LEVER
    np.testing.assert_allclose(moved - still, wanted, rtol=0.03, atol=2e-7)


def test_independent_pins_follow_the_tightest() -> None:
    """Pin radius sigma 1 um (section 2): 0.110' to about 0.054' on one disc, and varying along a
    turn; on two discs about 0, and half the turn interferes. The linear model knows neither."""
    rng = np.random.default_rng(1)
    errors = PartErrors(pin_radius=1e-6 * rng.standard_normal((200, 1, 40)))
    single, double = (performance.backlash(one, errors, CRANK) * RATIO / ARCMIN for one in (one_disc(), UNIT))
    np.testing.assert_allclose(single.mean(), 0.055, atol=0.003)
    assert single.std(axis=1).mean() > 0.05
    np.testing.assert_allclose(double.mean(), 0.0, atol=0.01)
    np.testing.assert_allclose(np.mean(double < 0.0), 0.5, atol=0.03)


def test_common_rotation_of_the_pins_is_no_backlash() -> None:
    """Section 2: a position error common to all pins is a pure rotation.

    Lever arms are those of the nominal position: a turn of 5 um leaves 3 nm, 0.2 % of backlash.
    """
    turned = PartErrors(tangential_position=np.full((1, 1, 1), 5e-6))
    moved, still = (performance.backlash(UNIT, one, PITCH) for one in (turned, PERFECT))
    np.testing.assert_allclose(moved.mean(), still.mean(), rtol=3e-3)
    first_order = 2.0 * 2.0 * 0.8125 * 5e-6 / LEVER  # what it would add if it were backlash
    assert abs(moved.mean() - still.mean()) < 1e-3 * first_order


def test_bearing_clearance_adds_its_share() -> None:
    """phi_3 = c/a_0 of document B, in backlash and, both ways, in lost motion."""
    loose = PartErrors(bearing_clearance=np.full((1, 1, 1), 2e-6))
    for measure in (performance.backlash, performance.lost_motion):
        moved, still = (measure(UNIT, one, CRANK) for one in (loose, PERFECT))
        np.testing.assert_allclose((moved - still) * RATIO, 2e-6 / 0.036, rtol=1e-9)


# Balance.


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.floats(-2058.0, 2058.0), min_size=3, max_size=8))
def test_twist_is_monotone_in_torque(seed: int, torques: list[float]) -> None:
    rng = np.random.default_rng(seed)
    errors = PartErrors(pin_radius=2e-6 * rng.standard_normal((1, 2, 40)))
    ordered = np.array(sorted(torques))
    found = performance.torque_twist(UNIT, errors, rng.uniform(0.0, 6.0, 2), ordered)
    assert np.all(np.diff(found[0]) >= 0.0)
    pulled = np.diff(ordered) > 1e-3
    assert np.all(np.diff(found[0])[pulled] > 0.0)


UNEVEN = PartErrors(
    pin_radius=1e-6 * np.random.default_rng(7).standard_normal((6, 2, 40)),
    disc_offset=np.full((6, 2), 1e-6),
    crank_phase=2e-4 * np.random.default_rng(8).standard_normal((6, 2, 2)),
    shift=1e-6 * np.random.default_rng(9).standard_normal((6, 2)),
    pitch=np.full((1, 2), 2e-6),
    pitch_phase=np.array([[0.5, 2.5]]),
    bearing_clearance=np.abs(1e-6 * np.random.default_rng(10).standard_normal((6, 2, 2))),
    bore_radial=1e-6 * np.random.default_rng(11).standard_normal((6, 2, 2)),
    bore_tangential=1e-6 * np.random.default_rng(12).standard_normal((6, 2, 2)),
)
TORQUES = [412.0, -412.0, 21.0, -5.0, 0.0, 1e-3]


@pytest.mark.parametrize("torque", TORQUES[:4])
def test_forces_on_the_pins_hold_the_torque(torque: float) -> None:
    found = UNIT.equilibrium(UNEVEN, CRANK[::8], torque)
    assert np.max(np.abs(found.residual)) < 1e-9 * abs(torque)
    assert found.pin_forces.min() == 0.0
    np.testing.assert_array_equal(found.loaded, np.sum(found.pin_forces > 0.0, axis=-1))


@pytest.mark.parametrize("torque", TORQUES)
@pytest.mark.parametrize("contact", [UNIT, RIGID], ids=["springs", "rigid"])
def test_kernel_and_arrays_agree(contact: LoadedContact, torque: float) -> None:
    angles = turn_angles(39 * 7)
    found = contact.rotation(UNEVEN, angles, torque)
    np.testing.assert_allclose(found, contact.mesh(UNEVEN, angles).rotation(torque), atol=1e-14)


@pytest.mark.parametrize("torque", [412.0, -21.0])
def test_kernel_and_arrays_agree_where_discs_jam(torque: float) -> None:
    """Pins 60 um too thick: both flanks bear at once, also under torque."""
    angles = turn_angles(39 * 2)
    jammed = PartErrors(pin_radius=60e-6 + UNEVEN.pin_radius)
    mesh = UNIT.mesh(jammed, angles)
    arm, gap = mesh.gaps.lever, mesh.gaps.gap
    assert np.any((gap < 0.0) & (arm > 0.0)) and np.any((gap < 0.0) & (arm < 0.0))
    found = UNIT.rotation(jammed, angles, torque)
    np.testing.assert_allclose(found, mesh.rotation(torque), atol=1e-14)


def test_kernel_takes_stiffness_and_torque_per_unit_and_angle() -> None:
    rng = np.random.default_rng(2)
    uneven = replace(
        UNIT,
        normal_stiffness=2e8 * rng.uniform(0.5, 2.0, (6, 1, 1)),
        series_stiffness=58.5 / ARCMIN * rng.uniform(0.5, 2.0, (50, 2)),
    )
    torque = rng.uniform(-412.0, 412.0, (6, 50))
    found = uneven.rotation(UNEVEN, CRANK[:50], torque)
    np.testing.assert_allclose(found, uneven.equilibrium(UNEVEN, CRANK[:50], torque).rotation, atol=1e-14)


def test_one_pin_in_closed_form() -> None:
    """Discs 1 mm too thin but for one pin: g/l, then 1/(k l^2) and, in series, 1/K_d per N m."""
    thick = PartErrors(pin_radius=one_pin(1e-3, 2), equidistance=np.full((1, 2), 1e-3))
    angle = np.array([1.2])
    mesh = UNIT.mesh(thick, angle)
    gap, arm = mesh.gaps.gap[0, 0, 0, 0], mesh.gaps.lever[0, 0, 0]
    assert arm > 0.02
    torque = 10.0
    wanted = gap / arm + torque / RATIO * (1.0 / (2e8 * arm**2) + ARCMIN / 58.5)
    np.testing.assert_allclose(mesh.rotation(torque)[0, 0] * RATIO, wanted, rtol=1e-12)
    found = UNIT.equilibrium(thick, angle, torque)
    np.testing.assert_allclose(found.pin_forces.max(), torque / RATIO / arm, rtol=1e-12)
    assert found.loaded.sum() == 1


def test_first_contact_either_way_without_torque() -> None:
    mesh = UNIT.mesh(PERFECT, PITCH)
    backward, forward = mesh.touch()
    np.testing.assert_allclose(mesh.rotation(0.0, 1), forward, rtol=1e-12)
    np.testing.assert_allclose(mesh.rotation(0.0, -1), backward, rtol=1e-12)
    assert np.all(mesh.torque(0.5 * (forward + backward))[0] == 0.0)


def test_stiffness_is_the_slope_of_the_torque() -> None:
    mesh = UNIT.mesh(UNEVEN, CRANK[:40])
    rotation = mesh.rotation(300.0)
    torque, stiffness = mesh.torque(rotation)
    np.testing.assert_allclose(torque, 300.0, rtol=1e-12)
    more, less = (mesh.torque(rotation + step)[0] for step in (1e-11, -1e-11))
    np.testing.assert_allclose((more - less) / 2e-11, stiffness, rtol=1e-4)


def test_extra_turn_of_a_disc_is_its_angular_error() -> None:
    turned = PartErrors(angle=np.array([[1e-5, -2e-5]]))
    rotation = np.full((1, 5), 1e-4)
    found = UNIT.mesh(PERFECT, CRANK[:5]).torque(rotation, np.array([1e-5, -2e-5]))
    wanted = UNIT.mesh(turned, CRANK[:5]).torque(rotation)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_unequal_sharing_lets_order_39_through() -> None:
    """Section 5: common errors cancel at odd orders only where the discs share equally."""
    errors = PartErrors(pin_radius=one_pin(3e-6, 1))
    unequal = replace(UNIT, series_stiffness=np.array([50.0, 67.0]) / ARCMIN)
    assert amplitudes(UNIT.rotation(errors, TURN, 412.0))[39] < 1e-9
    assert amplitudes(unequal.rotation(errors, TURN, 412.0))[39] > 0.01


def test_torque_beyond_the_momentary_one_is_warned_of_and_computed() -> None:
    with pytest.warns(OverloadWarning, match="2100 N m is beyond the momentary torque 2058 N m"):
        found = UNIT.equilibrium(PERFECT, PITCH[:3], 2100.0)
    assert np.max(np.abs(found.residual)) < 1e-9 * 2100.0


def test_stiffness_must_be_positive() -> None:
    with pytest.raises(ValueError, match="series_stiffness must be above 0"):
        LoadedContact(series_stiffness=0.0)


def test_transmission_error_is_what_the_output_lacks() -> None:
    found = performance.transmission_error(UNIT, PERFECT, PITCH, 412.0)
    np.testing.assert_array_equal(found, -UNIT.rotation(PERFECT, PITCH, 412.0))
