"""Gaps of the loaded contact against the outline of a disc, drawn on its own in the housing."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.errors import InputError
from tolevo.models.rv_reducer.contact.contact import LoadedContact, faults
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, PartErrors, displacements, gaps, lever
from tolevo.models.rv_reducer.geometry import RvGeometry

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
GEOMETRY = ContactGeometry()
UNMODIFIED = replace(GEOMETRY, dr_rp=0.0, dr_p=0.0)
ANGLES = np.array([0.3, 2.9, 77.0])
R, E, Z = 64e-3, 1.3e-3, 40
RNG = np.random.default_rng(5)


def outline(near: float, dr_rp: float, dr_p: float, pin: float = 3e-3) -> Complex:
    """Points of a disc's outline around the angle `near`, in its own axes, 40 nm apart."""
    u = near + np.linspace(-0.025, 0.025, 80_001)
    curve = (R + dr_p) * np.exp(1j * u) - E * np.exp(1j * Z * u)
    along = 1j * ((R + dr_p) * np.exp(1j * u) - Z * E * np.exp(1j * Z * u))
    return np.asarray(curve + 1j * along / abs(along) * (pin + dr_rp))


def distances(pins: Complex, centre: complex, turn: float, dr_rp: float, dr_p: float) -> Array:
    """Distance of pin centres from a disc's outline in the housing, its centre and turn given."""
    found = []
    for pin in pins:
        own = (pin - centre) * np.exp(-1j * turn)
        points = outline(float(np.angle(own)), dr_rp, dr_p)
        at = int(np.argmin(abs(points - own)))
        a, b = points[at - 1], points[at + 1]  # the chord is within 1e-12 m of the outline
        found.append(abs(((own - a) * (b - a).conjugate()).imag) / abs(b - a))
    return np.array(found)


def housing() -> Complex:
    return np.asarray(R * np.exp(2j * np.pi * np.arange(40) / 40), dtype=np.complex128)


@pytest.mark.parametrize("disc", [0, 1])
@pytest.mark.parametrize("psi", ANGLES)
def test_unmodified_profile_touches_every_pin(disc: int, psi: float) -> None:
    """Gaps under 1 nm all around without load, both by the model and in the drawing."""
    found = gaps(UNMODIFIED, PartErrors(), np.array([psi])).gap[0, 0, disc]
    np.testing.assert_allclose(found, 0.0, atol=1e-9)
    centre, turn = E * np.exp(1j * (psi + np.pi * disc)), np.pi * disc - psi / 39
    drawn = distances(housing(), complex(centre), turn, 0.0, 0.0) - 3e-3
    np.testing.assert_allclose(drawn, 0.0, atol=1e-9)


@pytest.mark.parametrize("disc", [0, 1])
def test_gaps_of_the_modified_profile_are_those_of_the_drawing(disc: int) -> None:
    for psi in ANGLES:
        found = gaps(GEOMETRY, PartErrors(), np.array([psi])).gap[0, 0, disc]
        centre, turn = E * np.exp(1j * (psi + np.pi * disc)), np.pi * disc - psi / 39
        drawn = distances(housing(), complex(centre), turn, -40e-6, -70e-6) - 3e-3
        np.testing.assert_allclose(found, drawn, atol=1e-9)


def random_errors(size: float) -> PartErrors:
    def some(*shape: int) -> Array:
        return RNG.uniform(-size, size, (1, *shape))

    return PartErrors(
        pin_radius=some(2, 40),
        hole_radius=some(2, 40),
        radial_position=some(2, 40),
        tangential_position=some(2, 40),
        equidistance=some(2),
        shift=some(2),
        pitch=some(2),
        pitch_phase=np.array([[0.4, 2.0]]),
        disc_offset=some(2),
        disc_offset_phase=np.array([[1.0, -2.0]]),
        crank_phase=some(2, 2) * 100.0,
        eccentricity=some(2, 2),
        bore_radial=some(2, 2),
        bore_tangential=some(2, 2),
        circle_radius=some(),
        circle_offset=some(),
        circle_phase=np.array([0.7]),
    )


def drawn_gaps(errors: PartErrors, psi: float, disc: int) -> Array:
    """The same errors put into the drawing."""
    e = {name: np.asarray(getattr(errors, name))[0] for name in errors.__slots__ if np.ndim(getattr(errors, name))}
    alpha = 2.0 * np.pi * np.arange(40) / 40
    radius = R + e["circle_radius"] + e["radial_position"][disc]
    pins = radius * np.exp(1j * (alpha + e["tangential_position"][disc] / R))
    pins = pins + e["circle_offset"] * np.exp(1j * e["circle_phase"])
    own = np.pi * disc - psi / 39
    cranks = (E + e["eccentricity"][:, disc]) * np.exp(1j * (psi + np.pi * disc + e["crank_phase"][:, disc]))
    centre = cranks.mean() + e["disc_offset"][disc] * np.exp(1j * (own + e["disc_offset_phase"][disc]))
    bore = e["bore_radial"][:, disc] + 1j * e["bore_tangential"][:, disc]
    centre -= np.mean(bore * np.exp(1j * (np.array([0.0, np.pi]) - psi / 39)))  # as the cranks lie
    # the teeth facing a pin are displaced as one body
    tooth = 0.5 * e["pitch"][disc] / R * np.cos(alpha - own - e["pitch_phase"][disc])
    about = E * np.exp(1j * (psi + np.pi * disc))
    pins = centre + (pins - centre - (housing() - about)) + (housing() - about) * np.exp(-1j * tooth)
    distance = distances(pins, complex(centre), own, -40e-6 + e["equidistance"][disc], -70e-6 + e["shift"][disc])
    return np.asarray(distance - 3e-3 - e["pin_radius"][disc] + e["hole_radius"][disc])


@pytest.mark.parametrize("disc", [0, 1])
def test_gaps_with_every_error_are_those_of_the_drawing(disc: int) -> None:
    errors = random_errors(5e-6)
    phi = GEOMETRY.phase(ANGLES)[:, disc]
    near = np.cos(phi) > np.cos(np.radians(25.0))
    for at, psi in enumerate(ANGLES):
        drawn = drawn_gaps(errors, float(psi), disc)
        exact = gaps(GEOMETRY, errors, np.array([psi]), exact=True).gap[0, 0, disc]
        np.testing.assert_allclose(exact, drawn, atol=1e-9)
        found = gaps(GEOMETRY, errors, np.array([psi])).gap[0, 0, disc]
        np.testing.assert_allclose(found[~near[at]], drawn[~near[at]], atol=1e-9)


@pytest.mark.parametrize(("size", "least", "within"), [(1e-6, 5.0, 1e-9), (5e-6, 25.0, 1e-9)])
def test_third_order_is_as_close_as_promised(size: float, least: float, within: float) -> None:
    angles, errors = RNG.uniform(0.0, 245.0, 300), random_errors(size)
    found, exact = (gaps(GEOMETRY, errors, angles, one).gap for one in (False, True))
    near = np.cos(GEOMETRY.phase(angles)) > np.cos(np.radians(least))
    assert np.max(np.abs(found - exact)[:, ~near]) < within


@pytest.mark.parametrize("geometry", [GEOMETRY, UNMODIFIED])
def test_lever_is_the_gap_closed_by_turning_forward(geometry: ContactGeometry) -> None:
    """The drawing turned clockwise by 1e-6 rad about the disc's centre, either way."""
    psi, step = 0.3, 1e-6
    centre = complex(E * np.exp(1j * psi))
    before, after = (
        distances(housing(), centre, -psi / 39 - turn, geometry.dr_rp, geometry.dr_p) for turn in (-step, step)
    )
    found = gaps(geometry, PartErrors(), np.array([psi])).lever[0, 0]
    away = np.cos(psi - 2.0 * np.pi * np.arange(40) / 40) < np.cos(np.radians(12.0))
    np.testing.assert_allclose((0.5 * (before - after) / step)[away], found[away], atol=2e-6)


def test_levers_of_the_unmodified_profile_are_the_closed_form() -> None:
    phi = UNMODIFIED.phase(ANGLES)
    found = gaps(UNMODIFIED, PartErrors(), ANGLES).lever
    np.testing.assert_allclose(found, lever(UNMODIFIED, phi), atol=1e-15)


def test_eccentric_of_a_crank_turns_and_moves_its_disc() -> None:
    """A displaced eccentric: half of it moves the disc, half over a_0 turns it about the other."""
    shifted = np.zeros((1, 2, 2))
    shifted[0, 0, 0] = 1e-6  # eccentricity of crank 1 at disc 1
    found = gaps(GEOMETRY, PartErrors(eccentricity=shifted), ANGLES)
    carrier = -ANGLES / 39
    counter = 1e-6 * np.sin(ANGLES - carrier) / (2.0 * 0.036)
    np.testing.assert_allclose(found.turn[0, :, 0], -counter, rtol=1e-9)
    np.testing.assert_allclose(found.turn[0, :, 1], 0.0, atol=1e-20)


@pytest.mark.parametrize("cranks", [2, 3])
def test_bores_place_a_disc_as_a_rigid_body(cranks: int) -> None:
    """Displaced bores brought onto the cranks by the rotation and translation of least squares."""
    geometry = ContactGeometry(cranks=cranks)
    bores = 1e-6 * np.random.default_rng(cranks).standard_normal((2, 1, cranks, 2))
    found = displacements(geometry, PartErrors(bore_radial=bores[0], bore_tangential=bores[1]))
    for disc in range(2):
        line = np.exp(1j * (2.0 * np.pi * np.arange(cranks) / cranks - np.pi * disc))
        wanted = 0.036 * line
        placed = wanted + (bores[0] + 1j * bores[1])[0, :, disc] * line
        turn = np.angle(np.vdot(placed - placed.mean(), wanted))  # counter-clockwise
        moved = -placed.mean() * np.exp(1j * turn)
        np.testing.assert_allclose(found.angle[0, disc], -turn, rtol=1e-3, atol=1e-12)
        np.testing.assert_allclose(found.offset[0, disc], moved, rtol=1e-3, atol=1e-12)


# Bad input.


@pytest.mark.parametrize(("dr_rp", "dr_p", "angle"), [(-40e-6, -60e-6, 35.66), (-10e-6, 0.0, 0.0), (20e-6, 50e-6, 0.0)])
def test_interfering_modification_is_named_with_its_angle(dr_rp: float, dr_p: float, angle: float) -> None:
    with pytest.raises(InputError) as caught:
        LoadedContact(replace(GEOMETRY, dr_rp=dr_rp, dr_p=dr_p))
    (fault,) = caught.value.faults
    assert fault.place == "parameters.dr_p_mm"
    assert "interferes" in fault.message
    named = float(fault.message.split("angle of ")[1].split(" deg")[0])
    np.testing.assert_allclose(named, angle, atol=2.0)  # first order: the angle where contact starts


def cusps(pin: float) -> bool:
    """Whether the outline turns back on itself: its speed along the curve changes sign."""
    u = np.linspace(0.0, 2.0 * np.pi / 39, 20_001)
    curve = R * np.exp(1j * u) - E * np.exp(1j * Z * u)
    along = 1j * (R * np.exp(1j * u) - Z * E * np.exp(1j * Z * u))
    drawn = curve + 1j * along / abs(along) * pin
    forward = np.real(np.diff(drawn) * along[:-1].conj())
    return bool(np.any(forward < 0.0) and np.any(forward > 0.0))


@pytest.mark.parametrize("pin", [3e-3, 4.5e-3, 4.59e-3, 4.61e-3, 4.8e-3, 6.5e-3])
def test_undercut_is_named_where_the_outline_turns_back(pin: float) -> None:
    geometry = ContactGeometry(RvGeometry(pin_radius=pin), dr_rp=0.0, dr_p=0.0)
    found = [fault for fault in faults(geometry) if "undercut" in fault.message]
    assert bool(found) == cusps(pin)
    assert all(fault.place == "parameters.pin_radius_mm" and "deg" in fault.message for fault in found)


def test_other_faults_of_the_geometry() -> None:
    (wide,) = faults(ContactGeometry(RvGeometry(eccentricity=1.7e-3)))
    assert wide.place == "parameters.eccentricity_mm"
    (many,) = faults(ContactGeometry(discs=3))
    assert "must divide the 40 pins" in many.message


def test_wrong_errors_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="bearing_clearance must not be negative"):
        PartErrors(bearing_clearance=-1e-6)
    with pytest.raises(ValueError, match="pin_radius must be finite"):
        PartErrors(pin_radius=np.full((1, 1, 1), np.nan))
    with pytest.raises(ValueError, match="circle_radius must"):
        PartErrors(circle_radius=np.zeros((2, 2)))
    with pytest.raises(ValueError, match="different numbers of units"):
        _ = PartErrors(circle_radius=np.zeros(2), pin_radius=np.zeros((3, 1, 1))).units
    with pytest.raises(ValueError, match="pin_radius must fit"):
        gaps(GEOMETRY, PartErrors(pin_radius=np.zeros((1, 2, 39))), ANGLES)
