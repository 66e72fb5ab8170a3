"""Nearest points by brute force, orders of the series, and symmetries of pins and discs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.rv_reducer.contact.contact import LoadedContact, faults
from tolevo.models.rv_reducer.contact.declared import PARAMETERS
from tolevo.models.rv_reducer.contact.geometry import (
    ContactGeometry,
    Nominal,
    PartErrors,
    curve,
    foot,
    gaps,
    nominal_pin,
)

Array = NDArray[np.float64]
GEOMETRY = ContactGeometry()
ANGLES = np.array([0.3, 1.7, 4.1])


def test_foot_is_the_nearest_of_many_points() -> None:
    """No point of C from -8 to 8 mrad is nearer, also where a pin has two feet."""
    rng = np.random.default_rng(3)
    phi = rng.uniform(-0.3, 0.3, 200)
    moved = 20e-6 * (rng.uniform(-1.0, 1.0, 200) + 1j * rng.uniform(-1.0, 1.0, 200))
    pin = nominal_pin(GEOMETRY, phi) + moved
    found = np.abs(pin - curve(GEOMETRY, phi, foot(GEOMETRY, phi, pin)).point)
    v = np.linspace(-8e-3, 8e-3, 1601)[:, None]
    drawn = np.abs(pin - curve(GEOMETRY, phi, np.broadcast_to(v, (1601, 200))).point)
    assert np.all(found <= drawn.min(axis=0) + 1e-12)


@pytest.mark.parametrize(("share", "order"), [(0.0, 4), (0.5, 3)])
def test_order_of_what_the_series_leaves_out(share: float, order: int) -> None:
    """Half of a pin's displacement leaves a sixteenth of the difference to the nearest point.

    With a shift of the profile beside it an eighth is left: only the second order of both is kept.
    """
    phi = np.concatenate([np.linspace(0.9, 2.5, 12), np.linspace(-2.5, -0.9, 12)])
    nominal, missed = Nominal.at(GEOMETRY, phi), []
    for size in (200e-6, 100e-6):
        moved, shift = np.full(24, size * (0.6 + 0.8j)), share * size
        pin = nominal_pin(GEOMETRY, phi) + moved
        at = curve(GEOMETRY, phi, foot(GEOMETRY, phi, pin, shift), shift)
        normal = -1j * at.first / np.abs(at.first)
        exact = np.real((pin - at.point) * normal.conj()) + GEOMETRY.dr_rp
        missed.append(nominal.displaced(moved[None], np.array(shift))[0] - exact)
    ratio = np.median(np.abs(missed[0])) / np.median(np.abs(missed[1]))
    assert abs(np.log2(ratio) - order) < 0.2


def test_circle_of_pins_that_grows_moves_every_pin_outward() -> None:
    size = 5e-6
    grown = gaps(GEOMETRY, PartErrors(circle_radius=np.array([size])), ANGLES)
    outward = gaps(GEOMETRY, PartErrors(radial_position=np.full((1, 2, 40), size)), ANGLES)
    np.testing.assert_allclose(outward.gap, grown.gap, rtol=0.0, atol=1e-16)
    # outward along the normal at the pins that touch the outer flank: more room on average
    assert np.mean(outward.gap - gaps(GEOMETRY, PartErrors(), ANGLES).gap) > 0.5 * size


def test_four_discs_are_one_disc_seen_from_four_sides() -> None:
    """Seen in axes turned with its eccentric every disc meets the same pins, ten further on."""
    four = replace(GEOMETRY, discs=4)
    wrong = PartErrors(eccentricity=np.full((1, 2, 4), 3e-6))
    found = gaps(four, wrong, ANGLES).gap
    for disc in range(4):
        turned = np.roll(found[:, :, disc], -10 * disc, axis=-1)
        np.testing.assert_allclose(turned, found[:, :, 0], rtol=0.0, atol=1e-15)


def test_phase_of_an_eccentric_turns_each_disc_by_its_angle_to_the_cranks() -> None:
    """A disc's eccentric stands at psi + a against a line of cranks at -psi/z_c: what turns the
    disc is the same wherever the angle between the two, psi (1 + 1/z_c) + a, is the same.
    """
    four = replace(GEOMETRY, discs=4)
    phase = np.zeros((1, 2, 4))
    phase[:, 0] = 1e-4
    ahead = 0.5 * np.pi * np.arange(4) / (1.0 + 1.0 / four.nominal.cycloid_teeth)
    for psi in ANGLES:
        later = gaps(four, PartErrors(crank_phase=phase), psi - ahead).turn[0]
        first = later[0, 0]
        np.testing.assert_allclose(np.diag(later), first, rtol=1e-9)


def test_exact_contact_has_the_gaps_of_the_nearest_points() -> None:
    """A pin circle of 100 um runout: the series is off by more than 10 nm somewhere."""
    errors = PartErrors(circle_offset=np.array([1e-4]))
    exact = replace(LoadedContact(), exact=True).mesh(errors, ANGLES).gaps.gap
    phi = GEOMETRY.phase(ANGLES)
    pin = nominal_pin(GEOMETRY, phi) + 1e-4 * np.exp(-1j * GEOMETRY.pin_angles)
    v = np.linspace(-2e-2, 2e-2, 4001)[:, None]
    for disc, pin_at in ((0, 3), (1, 17), (0, 30)):
        own, at = phi[:, disc, pin_at], pin[:, disc, pin_at]
        c = curve(GEOMETRY, own, np.broadcast_to(v, (4001, 3)))
        drawn = np.min(np.abs(at - c.point), axis=0)
        signed = np.abs(exact[0, :, disc, pin_at] - GEOMETRY.dr_rp)
        # points 10 urad apart, 0.6 um: within 0.05 um^2/(2 x 30 um) of the foot's distance
        np.testing.assert_allclose(signed, drawn, rtol=0.0, atol=2e-9)
    series = LoadedContact().mesh(errors, ANGLES).gaps.gap
    assert np.max(np.abs(series - exact)) > 1e-8


def test_pins_must_be_one_more_than_the_teeth() -> None:
    wrong = replace(GEOMETRY, nominal=replace(GEOMETRY.nominal, cycloid_teeth=38))
    assert "parameters.pins" in [one.place for one in faults(wrong)]


@pytest.mark.parametrize("rotation", [-0.02, -1e-4, 1e-4, 0.02])
def test_torque_of_rigid_discs_is_the_sum_over_the_pins(rotation: float) -> None:
    """k l (l x - g) of every pin that is closed, also where all of a flank bear."""
    errors = PartErrors(pin_radius=1e-6 * np.random.default_rng(5).standard_normal((1, 2, 40)))
    mesh = replace(LoadedContact(), series_stiffness=np.inf).mesh(errors, ANGLES)
    arm, ratio = mesh.gaps.lever, GEOMETRY.output_ratio
    closed = np.maximum(arm * rotation * ratio - mesh.gaps.gap[0], 0.0)
    torque = ratio * np.sum(2e8 * arm * closed, axis=(1, 2))
    stiffness = ratio**2 * np.sum(2e8 * arm**2 * (closed > 0.0), axis=(1, 2))
    found = mesh.torque(np.full((1, 3), rotation))
    np.testing.assert_allclose(found[0][0], torque, rtol=1e-9)
    np.testing.assert_allclose(found[1][0], stiffness, rtol=1e-9)


def test_rotation_of_an_exact_contact_is_that_of_its_gaps() -> None:
    """By its meshes: compiled code knows the series alone."""
    errors = PartErrors(circle_offset=np.array([1e-4]))
    exact = replace(LoadedContact(), exact=True)
    found = exact.rotation(errors, ANGLES, 412.0)
    turned = exact.mesh(errors, ANGLES).torque(found)[0]
    np.testing.assert_allclose(turned, 412.0, rtol=1e-9)


def test_what_the_contact_refuses_is_out_of_its_declared_ranges() -> None:
    """Stiffness and torque of zero are refused: a range with its end left out says the same."""
    ranges = {one.name: (one.low, one.open_low) for one in PARAMETERS}
    for name in ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin",
                 "rated_torque_Nm", "momentary_torque_Nm"):  # fmt: skip
        assert ranges[name] == (0.0, True)


def test_foot_is_no_farther_than_points_a_milliradian_apart() -> None:
    """Pins displaced by far more than any error, at bottoms of tooth spaces."""
    rng = np.random.default_rng(1)
    phi = rng.uniform(-0.5, 0.5, 4000)
    moved = 60e-6 * (rng.uniform(-1.0, 1.0, 4000) + 1j * rng.uniform(-1.0, 1.0, 4000))
    pin = nominal_pin(GEOMETRY, phi) + moved
    found = np.abs(pin - curve(GEOMETRY, phi, foot(GEOMETRY, phi, pin)).point)
    near = np.cos(phi) > 0.9
    for v in 1e-3 * np.arange(-4, 5):
        away = np.abs(pin - curve(GEOMETRY, phi, np.full(4000, v)).point)
        assert np.all(found[near] <= away[near] + 1e-12)
