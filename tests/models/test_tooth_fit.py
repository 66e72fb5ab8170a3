"""Tooth modification by a linear programme, against scans, known answers and the physics notes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.rv_reducer import cycloid as targets
from tolevo.models.rv_reducer.cycloid import CLEARANCES, Programme, fit, printed_clearance
from tolevo.models.rv_reducer.geometry import RvGeometry, clearance, contact_angle, modification_backlash, raw_clearance
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
GEOMETRY = RvGeometry()
K1 = 1.3 * 40.0 / 64.0
PHI = targets.angles(360)
GAP = 30e-6
EVERYWHERE = (0.0, np.pi)
PRINTED = np.array(-40e-6), np.array(-70e-6)


def band(low: float, high: float) -> tuple[float, float]:
    return float(np.radians(low)), float(np.radians(high))


def sum_of_deviations(kind: str, target: targets.Target, dr_rp: Array, dr_p: Array) -> Array:
    """By the formulas of the notes, pairs (n,) at once."""
    root = np.sqrt(1.0 + K1**2 - 2.0 * K1 * np.cos(target.phi))
    normal, lever = (1.0 - K1 * np.cos(target.phi)) / root, np.sin(target.phi) / root
    shares = (np.ones_like(normal), normal)
    if kind == "after_contact":
        shares = (1.0 - lever, normal - np.sqrt(1.0 - K1**2) * lever)
    found = dr_rp[:, None] * shares[0] - dr_p[:, None] * shares[1]
    return np.asarray(np.abs(found - target.clearance) @ target.weight)


@pytest.mark.parametrize(("own_phase", "least", "at"), [(False, -0.095, 31.0), (True, -0.143, 0.0)])
def test_printed_clearance_at_the_printed_optimum(own_phase: bool, least: float, at: float) -> None:
    found = printed_clearance(GEOMETRY, *PRINTED, PHI, own_phase=own_phase)
    assert found.min() == pytest.approx(least * 1e-3, abs=5e-7)
    assert np.degrees(PHI[found.argmin()]) == pytest.approx(at, abs=0.6)


def test_printed_clearance_at_first_contact_by_hand() -> None:
    """There cos(phi - phi_0) = 1 and sqrt(S) = 1 - k1; the shift drops out."""
    phi = np.array([np.arccos(K1)])
    wanted = (-40e-6 * (1.0 - np.sin(phi)) - 1e-4 * 0.0507 * np.sin(phi)) / (1.0 - K1)
    found = printed_clearance(GEOMETRY, *PRINTED, phi, rotation=1e-4)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


@pytest.mark.parametrize(("film", "low", "high"), [(1.0, 30, 45), (1.9, 20, 60), (3.5, 20, 90), (6.1, 0, 180)])
def test_films_that_bring_the_printed_optimum(film: float, low: float, high: float) -> None:
    found = fit(GEOMETRY, targets.film(PHI, film * 1e-6, band(low, high)), GAP)
    assert found.dr_p == pytest.approx(-70e-6, abs=0.2e-6)
    assert found.dr_rp - found.dr_p == pytest.approx(GAP, rel=1e-9)
    assert float(modification_backlash(GEOMETRY, *PRINTED) / ARCMIN) == pytest.approx(0.11, abs=0.005)


@pytest.mark.parametrize(
    "target",
    [
        targets.film(PHI, 3.5e-6, band(20, 90)),
        targets.film(PHI, 6.1e-6, EVERYWHERE),
        targets.film(PHI, 0.0, EVERYWHERE),
        targets.near_conjugate(GEOMETRY, PHI, 0.05 * ARCMIN, GAP, band(20, 120)),
    ],
)
def test_after_contact_the_whole_flank_wants_no_equidistance(target: targets.Target) -> None:
    found = fit(GEOMETRY, target, GAP, "after_contact")
    assert (found.dr_rp, found.dr_p) == pytest.approx((0.0, -30e-6), abs=1e-11)
    pair = np.array(found.dr_rp), np.array(found.dr_p)
    assert float(modification_backlash(GEOMETRY, *pair) / ARCMIN) == pytest.approx(2.37, abs=0.005)


def test_after_contact_the_printed_pair_comes_of_a_turn_chosen_for_it() -> None:
    """Near-conjugate at 2.0', not at 1.2' (no equidistance) nor at 2.2' (no backlash)."""
    found = [
        fit(
            GEOMETRY, targets.near_conjugate(GEOMETRY, PHI, turn * ARCMIN, GAP, band(20, 120)), GAP, "after_contact"
        ).dr_rp
        for turn in (1.2, 2.0, 2.2)
    ]
    assert found == pytest.approx([0.0, -40.4e-6, -41.94e-6], abs=0.05e-6)


@pytest.mark.parametrize(
    ("kind", "target"),
    [
        ("raw", targets.film(PHI, 0.0, EVERYWHERE)),
        ("raw", targets.near_conjugate(GEOMETRY, PHI, 0.05 * ARCMIN, GAP, band(20, 120))),
        ("after_contact", targets.film(PHI, 1e-6, band(30, 45))),
    ],
)
def test_small_targets_lead_to_no_backlash(kind: str, target: targets.Target) -> None:
    """g4 binds. The last one shows that D does not lead to (0, -0.030) for every target."""
    found = fit(GEOMETRY, target, GAP, kind)
    assert (found.dr_rp, found.dr_p) == pytest.approx((-41.94e-6, -71.94e-6), abs=0.01e-6)


@pytest.mark.parametrize("kind", CLEARANCES)
@pytest.mark.parametrize("film", [1.0, 6.0, 20.0])
def test_fixed_gap_is_the_best_of_a_scan(kind: str, film: float) -> None:
    target = targets.film(PHI, film * 1e-6, band(20, 150))
    found = fit(GEOMETRY, target, GAP, kind)
    dr_rp = np.linspace(-GAP * np.sqrt(1 - K1**2) / (1 - np.sqrt(1 - K1**2)), 0.0, 20_001)
    scan = sum_of_deviations(kind, target, dr_rp, dr_rp - GAP)
    assert found.deviation <= scan.min() * (1.0 + 1e-9)
    assert found.deviation == pytest.approx(scan.min(), rel=1e-4)
    assert found.dr_rp == pytest.approx(dr_rp[scan.argmin()], abs=1e-8)
    assert abs(found.gap) < 1e-9 * found.deviation


@pytest.mark.parametrize("kind", CLEARANCES)
def test_free_gap_recovers_the_pair_whose_clearance_is_wanted(kind: str) -> None:
    pair = np.array(-25e-6), np.array(-61e-6)
    wanted = {"raw": raw_clearance, "after_contact": clearance}[kind](GEOMETRY, *pair, PHI)
    found = fit(GEOMETRY, targets.table(PHI, PHI, wanted), None, kind)
    assert (found.dr_rp, found.dr_p) == pytest.approx((-25e-6, -61e-6), rel=1e-6)
    assert found.deviation == pytest.approx(0.0, abs=1e-12)


def test_free_gap_is_the_best_of_a_grid() -> None:
    target = targets.near_conjugate(GEOMETRY, PHI, 0.5 * ARCMIN, GAP, band(20, 120))
    found = fit(GEOMETRY, target, None)
    dr_rp, dr_p = (one.ravel() for one in np.meshgrid(np.linspace(-30e-6, 0, 121), np.linspace(-60e-6, 0, 241)))
    allowed = dr_rp - np.sqrt(1 - K1**2) * dr_p >= 0.0
    grid = sum_of_deviations("raw", target, dr_rp[allowed], dr_p[allowed])
    assert found.deviation <= grid.min() * (1.0 + 1e-9)
    assert found.deviation == pytest.approx(grid.min(), rel=1e-2)
    assert found.bound == pytest.approx(found.deviation, rel=1e-9)


def test_bound_holds_for_any_multipliers() -> None:
    """min x + 2 y under x + y >= 1 in the unit square is 1, at (1, 0)."""
    one = np.ones(2)
    programme = Programme(
        cost=np.array([1.0, 2.0]),
        above=-one[None],
        below=np.array([-1.0]),
        equal=np.zeros((0, 2)),
        to=np.zeros(0),
        low=0.0 * one,
        high=one,
    )
    none = np.zeros(0)
    bounds = [programme.bound(np.array([y]), none) for y in (-1.0, -1.5, -0.5, 0.0, 3.0)]
    np.testing.assert_allclose(bounds, [1.0, 1.0, 0.5, 0.0, 0.0])


def test_a_gap_out_of_reach_is_said() -> None:
    with pytest.raises(ArithmeticError, match="g1 to g5"):
        fit(GEOMETRY, targets.film(PHI, 0.0, EVERYWHERE), 2e-3)


def test_near_conjugate_is_what_a_turn_closes_and_the_gap_at_the_ends() -> None:
    turn = 0.3 * ARCMIN
    found = targets.near_conjugate(GEOMETRY, PHI, turn, GAP, band(20, 120))
    closed = clearance(GEOMETRY, np.array(0.0), np.array(0.0), PHI, turn)
    working = targets.within(PHI, band(20, 120)) > 0.0
    np.testing.assert_allclose((found.clearance + closed)[working], 0.0, atol=1e-18)
    np.testing.assert_allclose(found.clearance[[0, -1]], GAP, rtol=1e-12)
    assert np.all((found.clearance + closed)[~working] > 0.0)


def test_film_reaches_most_at_first_contact() -> None:
    """The raw clearance is least at arccos(k1), so the narrow film holds it there."""
    found = fit(GEOMETRY, targets.film(PHI, 1e-6, band(30, 45)), GAP)
    pair = np.array(found.dr_rp), np.array(found.dr_p)
    curve = raw_clearance(GEOMETRY, *pair, PHI)
    assert PHI[curve.argmin()] == pytest.approx(contact_angle(GEOMETRY), abs=0.01)
    assert 0.0 < curve.min() < 1e-6


def test_table_leaves_out_what_it_does_not_cover_and_must_rise() -> None:
    found = targets.table(PHI, np.radians([10.0, 20.0]), np.array([1e-6, 3e-6]))
    assert np.degrees(PHI[found.weight > 0.0][[0, -1]]) == pytest.approx([10.0, 20.0])
    assert found.clearance[np.searchsorted(np.degrees(PHI), 14.9)] == pytest.approx(2e-6)
    with pytest.raises(ValueError, match="must rise"):
        targets.table(PHI, np.array([0.2, 0.1]), np.zeros(2))
