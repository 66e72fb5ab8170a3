"""Backlash against mesh force by the tooth modification, against closed forms and the notes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.rv_reducer.contact.contact import LoadedContact, backlash, loading, torque_twist
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from tolevo.problems.settings import Bound, Settings, VariableSetting
from tolevo.problems.tooth_modification import ToothModification
from tolevo.section import Value
from tolevo.testing import ProblemContract
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
FLANK = float(np.sqrt(1.0 - 0.8125**2))
PITCH = 2.0 * np.pi / 40.0 * np.arange(64) / 64


def outputs(*pairs: tuple[float, float], **parameters: Value) -> dict[str, Array]:
    return ToothModification(Settings(parameters=parameters)).outputs_of(np.array(pairs))


class TestToothModification(ProblemContract):
    problem_type = ToothModification


def test_printed_optimum_is_that_of_section_4() -> None:
    """0.1156' of a disc is 117/121 of it at the output; the formula gives the printed 0.11'."""
    found = outputs((-0.040, -0.070))
    assert found["backlash_arcmin"][0] == pytest.approx(0.1156 * 117.0 / 121.0, abs=5e-5)
    assert found["modification_backlash_arcmin"][0] == pytest.approx(0.1095, abs=5e-5)
    assert found["radial_gap_mm"][0] == pytest.approx(0.03, rel=1e-12)


def test_force_of_the_unmodified_profile_is_the_closed_form() -> None:
    """4 T_disc/(k1 z_c r_p), each disc with half of 412 N m times 117/121."""
    wanted = 4.0 * 206.0 * 117.0 / 121.0 / (0.8125 * 39.0 * 0.064)
    assert outputs((0.0, 0.0))["peak_mesh_force_N"][0] == pytest.approx(wanted, rel=2e-3)


def test_two_discs_are_one_with_half_the_torque() -> None:
    contact = LoadedContact(ContactGeometry(dr_rp=-30e-6, dr_p=-60e-6, true_levers=False), exact=True)
    load, found = loading(contact, PartErrors(), PITCH, 412.0), outputs((-0.030, -0.060))
    assert found["peak_mesh_force_N"][0] == pytest.approx(load.peak[0], rel=1e-9)
    assert found["mean_peak_force_N"][0] == pytest.approx(load.mean_peak[0], rel=1e-9)
    assert found["pins_loaded"][0] == pytest.approx(load.loaded[0], rel=1e-12)
    play = backlash(contact, PartErrors(), PITCH).mean() / ARCMIN
    assert found["backlash_arcmin"][0] == pytest.approx(play, rel=1e-9)
    torques = np.array([0.999, 1.001]) * contact.rated_torque
    secant = np.diff(torques) / np.diff(torque_twist(contact, PartErrors(), PITCH, torques))[0] * ARCMIN
    assert found["stiffness_Nm_per_arcmin"][0] == pytest.approx(secant, rel=2e-3)


def test_exact_backlash_is_near_the_formula() -> None:
    """First order: within 1 % of 117/121 of it, and 0.007' where it vanishes."""
    dr_rp = np.linspace(-0.041, 0.0, 8)
    found = outputs(*zip(dr_rp.tolist(), (dr_rp - 0.03).tolist(), strict=True))
    formula = found["modification_backlash_arcmin"] * 117.0 / 121.0
    np.testing.assert_allclose(found["backlash_arcmin"], formula, rtol=0.01, atol=0.007)


def test_search_and_report_agree() -> None:
    """Third order about the middle of the range, on half the angles, against the exact profile."""
    problem = ToothModification()
    rng = np.random.default_rng(0)
    x = rng.uniform([-0.05, -0.09], [0.0, -0.03], size=(50, 2))
    open_flank = x[:, 0] - FLANK * x[:, 1] > 0.0
    coarse, fine = (problem.outputs_of(x[open_flank], searching=s) for s in (True, False))
    assert open_flank.sum() > 20
    np.testing.assert_allclose(coarse["backlash_arcmin"], fine["backlash_arcmin"], atol=1e-3)
    np.testing.assert_allclose(coarse["peak_mesh_force_N"], fine["peak_mesh_force_N"], rtol=3e-3)


def test_force_grows_with_torque() -> None:
    forces = [outputs((-0.04, -0.07), torque_Nm=t)["peak_mesh_force_N"][0] for t in (100, 412, 1029)]
    assert forces[0] < forces[1] < forces[2]


def test_front_lies_where_the_radial_gap_is_least() -> None:
    """Of a grid of modifications those that nothing beats keep the gap of 0.03 mm.

    But for the end without backlash, where that of exact geometry is a few thousandths.
    """
    problem = ToothModification()
    dr_rp, gap = (one.ravel() for one in np.meshgrid(np.linspace(-0.05, 0.0, 26), np.linspace(0.03, 0.05, 11)))
    designs = np.stack([dr_rp, dr_rp - gap], axis=1)
    found = problem.outputs_of(designs)
    f = problem.objective_values(found)
    allowed = np.all(problem.violations(designs, found) <= 1e-9, axis=1)
    f, gap = f[allowed], gap[allowed]
    beaten = np.any(np.all(f[:, None] >= f[None] + [1e-4, 1.0], axis=-1), axis=1)
    kept = ~beaten & (f[:, 0] > 0.1)
    np.testing.assert_allclose(gap[kept], 0.03, atol=1e-9)
    assert kept.sum() > 15
    line = np.argsort(f[kept, 0])
    assert np.all(np.diff(f[kept][line, 1]) < 0.0)


@pytest.mark.parametrize("gap", [0.0, -np.inf])
def test_box_without_a_radial_gap(gap: float) -> None:
    """The unmodified profile is best in both; the worst ends have the largest shift."""
    ideal, nadir = ToothModification(Settings(limits={"radial_gap_mm": Bound(low=gap)})).box()
    best = outputs((0.0, 0.0))
    assert ideal == pytest.approx([0.0, best["peak_mesh_force_N"][0]], abs=1e-6)
    assert np.all(nadir > [3.0, 1300.0])


def test_references_are_the_printed_optimum_and_the_pair_without_backlash() -> None:
    found = ToothModification().references()
    np.testing.assert_array_equal(found["document B"], [-0.040, -0.070])
    pair = found["zero backlash, same radial gap"]
    np.testing.assert_allclose(pair, [-0.0419, -0.0719], atol=5e-5)


# ---------------------------------------------------------------- rotation-angle modification


def turned(*designs: tuple[float, float, float]) -> dict[str, Array]:
    return ToothModification(Settings(variables={"rotation_arcmin": VariableSetting()})).outputs_of(np.array(designs))


def test_turned_flanks_are_discs_that_are_turned_for_each_sense() -> None:
    """Forward a disc turned back by d_delta bears, backward one turned ahead; equal torque makes equal forces."""
    contact = LoadedContact(ContactGeometry(dr_rp=-40e-6, dr_p=-70e-6, true_levers=False, discs=1), exact=True)
    five = np.array([[-5e-6]])
    found, plain = turned((-0.045, -0.075, -0.4)), outputs((-0.045, -0.075))
    ends = [contact.mesh(PartErrors(equidistance=five, shift=five, angle=s * 0.4 * ARCMIN), PITCH).touch()[at]
            for s, at in ((1.0, 0), (-1.0, 1))]  # fmt: skip
    play = (ends[1] - ends[0]).mean() / ARCMIN
    assert found["backlash_arcmin"][0] == pytest.approx(play, rel=1e-9)
    assert found["backlash_arcmin"][0] > plain["backlash_arcmin"][0] + 0.7
    for name in ("peak_mesh_force_N", "pins_loaded", "stiffness_Nm_per_arcmin"):
        assert found[name][0] == pytest.approx(plain[name][0], rel=1e-9)


def test_closed_forms_with_three_amounts() -> None:
    """g4 against the contact, D_raw - d_delta e z_c sin(phi)/sqrt(S) over all phi, and g5, which no turn changes."""
    designs = [(-0.045, -0.075, -0.4), (-0.04, -0.07, -0.1), (-0.02, -0.05, 0.0), (-0.0419, -0.0719, -0.5)]
    found, plain = turned(*designs), outputs(*((a, b) for a, b, _ in designs))
    formula = found["modification_backlash_arcmin"] * 117.0 / 121.0
    np.testing.assert_allclose(found["backlash_arcmin"], formula, rtol=0.01, atol=0.012)
    phi = np.linspace(0.0, np.pi, 20_001)
    root = np.sqrt(1.0 + 0.8125**2 - 2.0 * 0.8125 * np.cos(phi))
    for at, (a, b, c) in enumerate(designs):
        raw = a - b * (1.0 - 0.8125 * np.cos(phi)) / root - c * ARCMIN * 50.7 * np.sin(phi) / root
        assert found["clearance_min_mm"][at] == pytest.approx(raw.min(), abs=1e-8)
    np.testing.assert_array_equal(found["conjugate_clearance_min_mm"], plain["conjugate_clearance_min_mm"])
    np.testing.assert_array_equal(
        turned((-0.04, -0.07, 0.0))["backlash_arcmin"], outputs((-0.04, -0.07))["backlash_arcmin"]
    )


def test_rotation_is_a_variable_where_it_is_stated() -> None:
    table = {"problem": "tooth_modification", "seed": 1, "variables": {"rotation_arcmin": {"low": -0.5, "high": 0.0}}}
    problem = read(table).problem
    assert problem is not None and problem.names == ["dr_rp_mm", "dr_p_mm", "rotation_arcmin"]
    assert problem.faults() == []
    low, high = problem.interval("modification_backlash_arcmin")
    assert (low, high) == pytest.approx((-0.16 / 50.7 / ARCMIN, 0.24 * FLANK / 50.7 / ARCMIN + 1.0))
    assert problem._corners().shape == (2, 3)
    np.testing.assert_array_equal(problem.references()["document B"], [-0.040, -0.070, 0.0])
    assert ToothModification().names == ["dr_rp_mm", "dr_p_mm"]
    with pytest.raises(InputError, match=r"variables.rotation_arcmin.value"):
        read({**table, "variables": {"rotation_arcmin": {"value": 0.2}}})


@pytest.mark.parametrize(
    ("parameters", "place"),
    [({"eccentricity_mm": 1.7}, "parameters.eccentricity_mm"), ({"pin_radius_mm": 20.0}, "parameters.pin_radius_mm")],
)
def test_faults(parameters: Mapping[str, Value], place: str) -> None:
    found = ToothModification(Settings(parameters=parameters)).faults()
    assert {one.place for one in found} == {place}


def test_impossible_gap_is_a_fault() -> None:
    problem = ToothModification()
    assert problem.faults() == []
    assert problem.interval("radial_gap_mm") == pytest.approx((-0.08, 0.12))
    low, high = problem.interval("modification_backlash_arcmin")
    unit = 2.0 / 50.7 / ARCMIN
    assert (low, high) == pytest.approx((-0.08 * unit, 0.12 * FLANK * unit))
