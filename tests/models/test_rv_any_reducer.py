"""Other reducers than the RV-40E: cranks fitted as rigid bodies, the held input, bent profiles."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from tests.models.loaded_units import modified_geometry, part_errors
from tolevo.configuration.reader import read
from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact, faults
from tolevo.models.rv_reducer.contact.geometry import Axes, ContactGeometry, Nominal, PartErrors, displacements
from tolevo.models.rv_reducer.geometry import RvGeometry, zero_backlash_pair
from tolevo.models.rv_reducer.population.contact import touch
from tolevo.models.rv_reducer.population.errors import Lattice, Scaled, Table, turn_lattice
from tolevo.models.rv_reducer.population.units import BaseSample, Profile, UnitDesign
from tolevo.problems.rv_reducer import RvReducer
from tolevo.units import ARCMIN, UM

Array = NDArray[np.float64]
SHIPPED = ("rv20e_like", "rv80e_like", "cycloidal_stage")


def shipped(name: str) -> RvReducer:
    problem = read(Path(str(files("tolevo.configs") / f"{name}.toml"))).problem
    assert isinstance(problem, RvReducer)
    return problem


# ---------------------------------------------------------------- any number of cranks


def fitted(
    geometry: ContactGeometry, psi: float, disc: int, journals: NDArray[np.complex128], bores: NDArray[np.complex128]
) -> tuple[complex, float]:
    """Displacement [um] and forward turn [arcmin] of a disc by least squares over its bearings.

    `journals` and `bores` (cranks,) are complex [um], in axes of the eccentric and along and across
    the line from the disc's centre to the bore. The output turns against the cranks: a forward turn
    is clockwise.
    """
    nominal, cranks = geometry.nominal, geometry.cranks
    carrier = -psi / nominal.cycloid_teeth + 2.0 * np.pi * np.arange(cranks) / cranks
    places = nominal.centre_distance / UM * np.exp(1j * carrier)
    eccentric = np.exp(1j * (psi + geometry.disc_angles[disc]))
    wanted = journals * eccentric - bores * np.exp(1j * carrier)
    rows = np.array(
        [[1.0, 0.0, -p.imag] for p in places] + [[0.0, 1.0, p.real] for p in places]
    )  # x and y of t + i turn p
    x, y, turn = np.linalg.lstsq(rows, np.concatenate([wanted.real, wanted.imag]), rcond=None)[0]
    return complex(x, y), -turn / ARCMIN


@pytest.mark.parametrize("cranks", [2, 3, 5])
def test_cranks_place_a_disc_as_a_rigid_body(cranks: int) -> None:
    """The fit is linear, as are the errors; those of journal phases are 1 nm off at 2 mrad."""
    geometry = ContactGeometry(RvGeometry(), cranks=cranks, true_levers=True)
    sample = BaseSample.draw(geometry, 8, np.random.default_rng(4))
    design = UnitDesign({"eccentricity": 3.0, "bore": 2.0, "crank_phase": 1.5}, stagger=0.0)
    psi = np.array([0.3, 40.0, 171.0])
    axes = Axes.at(geometry, psi)
    units = Scaled.of(geometry, sample, design)
    contact = displacements(geometry, part_errors(geometry, sample, design))
    z, ahead = sample.z, 1e-3 * geometry.nominal.eccentricity / UM
    for at, angle in enumerate(psi):
        for disc in range(geometry.discs):
            eccentric, own, crank = (one[at, disc] for one in (axes.eccentric, axes.disc, axes.crank))
            for unit in range(sample.units):
                one = (slice(None), disc, unit)
                journals = 3.0 * z["eccentricity"][one] + 1.5j * ahead * z["crank_phase"][one]
                bores = 2.0 * (z["bore_radial"][one] + 1j * z["bore_tangential"][one])
                centre, turn = fitted(geometry, float(angle), disc, journals, np.asarray(bores, dtype=np.complex128))
                pair = units.turning[disc, unit] * eccentric + units.offset[disc, unit] * own
                moved = units.ahead[disc, unit] - np.imag(units.around[disc, unit] * crank)
                np.testing.assert_allclose([pair, moved], [centre, turn], atol=1e-9)
                pair = contact.centre(axes)[unit, at, disc] / UM
                moved = contact.turn(axes)[unit, at, disc] / ARCMIN
                np.testing.assert_allclose([pair, moved], [centre, turn], atol=0.01)


# ---------------------------------------------------------------- what is held


def least_gap(geometry: ContactGeometry, psi: float, turn: float, rolling: float) -> float:
    """Least gap [m] of one disc and its pins after the carrier has turned by `turn` [rad].

    The cranks roll on by `rolling` times the turn. The distance of each pin's centre from the curve
    that it follows is read off 8,001 points, in axes of the disc.
    """
    nominal = geometry.nominal
    at = psi + rolling * turn
    disc = -psi / nominal.cycloid_teeth + turn
    pins = nominal.pin_circle_radius * np.exp(1j * geometry.pin_angles)
    seen = (pins - nominal.eccentricity * np.exp(1j * at)) * np.exp(-1j * disc)
    u = np.angle(seen)[:, None] + np.linspace(-0.02, 0.02, 8_001)
    big = (nominal.pin_circle_radius + geometry.dr_p) * np.exp(1j * u)
    small = nominal.eccentricity * np.exp(1j * nominal.pins * u)
    away = seen[:, None] - (big - small)
    nearest = np.argmin(np.abs(away), axis=1)
    rows = np.arange(nominal.pins)
    normal = (big - nominal.pins * small)[rows, nearest]
    signed = np.real(away[rows, nearest] * normal.conj()) / np.abs(normal)
    return float(np.min(signed) + geometry.dr_rp)


@pytest.mark.parametrize("involute_stage", [True, False])
@pytest.mark.parametrize("psi", [0.4, 2.1])
def test_backlash_with_the_input_held(involute_stage: bool, psi: float) -> None:
    """The disc is turned until it meets the pins; 2e-4' is 1 nm of the points of the curve.

    With the sun held the cranks roll on by 1 + z1/z2 with the carrier; 1.0345 times less backlash
    than with the cranks held, 0.02' here.
    """
    nominal = RvGeometry(0.05, 0.003, 0.0012, 29, 30, 61.0 if involute_stage else 29.0)
    geometry = ContactGeometry(nominal, -60e-6, -100e-6, discs=1, true_levers=True, involute_stage=involute_stage)
    rolling = 1.0 + 1.0 / ((61.0 - 1.0) / 30.0) if involute_stage else 0.0
    far = 5.0 * ARCMIN

    def gap(turn: float) -> float:
        return least_gap(geometry, psi, turn, rolling)

    ends = [brentq(gap, 0.0, side * far, xtol=1e-12) for side in (1.0, -1.0)]
    found = performance.backlash(LoadedContact(geometry), PartErrors(), np.array([psi]))
    assert gap(0.0) > 0.0
    assert (ends[0] - ends[1]) / ARCMIN > 0.5
    np.testing.assert_allclose(found[0, 0] / ARCMIN, (ends[0] - ends[1]) / ARCMIN, atol=2e-4)


def test_ratio_of_the_held_input() -> None:
    """117/121 of the RV-40E; cranks that stand carry nothing on."""
    assert ContactGeometry().output_ratio == pytest.approx(121.0 / 117.0, rel=1e-12)
    assert ContactGeometry(involute_stage=False).output_ratio == 1.0


# ---------------------------------------------------------------- shipped reducers


@pytest.mark.parametrize("name", SHIPPED)
def test_populations_of_shipped_reducers(name: str) -> None:
    """0.002' by the nearest point, as for the RV-40E, at document B's zones for its pin circle."""
    problem = shipped(name)
    geometry = problem.model.geometry
    row = {v.name: float(v.document or 0.0) for v in problem.variables} | {"stagger_arcmin": 0.05}
    pair = zero_backlash_pair(geometry.nominal, 35e-6)
    design = replace(problem.model.design(row), dr_rp=pair[0] + 3e-6, dr_p=pair[1])
    sample = BaseSample.draw(geometry, 16, np.random.default_rng(3))
    lattice = Lattice.of(geometry, turn_lattice(31, geometry.nominal.cycloid_teeth))
    table = Table.of(lattice, design.dr_rp, design.dr_p)
    units = Scaled.of(geometry, sample, design)
    found = touch(lattice, table, units).cycloid(geometry.output_ratio)
    contact = LoadedContact(modified_geometry(geometry, design), exact=True)
    errors = part_errors(geometry, sample, design)
    exact = performance.backlash(contact, errors, lattice.angles).T / ARCMIN
    np.testing.assert_allclose(found, exact, atol=0.002)
    assert np.std(exact) > 0.05


# ---------------------------------------------------------------- profiles of many bends


@pytest.mark.parametrize("eccentricity", [0.9e-3, 1.3e-3, 1.4e-3, 1.5e-3])
def test_nodes_are_enough_for_the_bends(eccentricity: float) -> None:
    """Distances by direct solution within 10 nm, 0.1 nm from 10 degrees: k1 from 0.56 to 0.94."""
    geometry = ContactGeometry(RvGeometry(eccentricity=eccentricity), true_levers=True)
    lattice = Lattice.of(geometry, turn_lattice(13, 39))
    profile = Profile.of(geometry, lattice.phase)
    for shift in (-131e-6, -62e-6, 11e-6):
        found = profile.at(shift)[0][0]
        exact = Nominal.at(replace(geometry, dr_rp=0.0, dr_p=shift), lattice.phase).gap
        np.testing.assert_allclose(found, exact, atol=1e-8)
        away = lattice.phase > np.radians(10.0)
        np.testing.assert_allclose(found[away], exact[away], atol=1e-10)


# ---------------------------------------------------------------- what cannot be built


@pytest.mark.parametrize(
    ("nominal", "discs", "places"),
    [
        (RvGeometry(cycloid_teeth=38), 2, ["parameters.pins"]),
        (RvGeometry(cycloid_teeth=40, pins=41), 2, ["parameters.discs"]),
        (RvGeometry(pin_radius=0.0051, eccentricity=0.0005), 2, ["parameters.pin_radius_mm"]),
        (RvGeometry(eccentricity=0.0016), 2, ["parameters.eccentricity_mm"]),
        (
            RvGeometry(pin_radius=0.0055, eccentricity=0.0017, pins=41),
            2,
            ["pins", "discs", "pin_radius_mm", "eccentricity_mm"],
        ),
    ],
    ids=["teeth", "discs", "overlap", "k1", "all"],
)
def test_every_fault_of_a_geometry(nominal: RvGeometry, discs: int, places: list[str]) -> None:
    found = faults(ContactGeometry(nominal, discs=discs))
    assert [one.place.split(".")[-1] for one in found] == [one.split(".")[-1] for one in places]


def test_pins_touch_where_the_chord_is_their_diameter() -> None:
    """2 r_p sin(pi/z_p) of the circle of the RV-40E is 10.043 mm."""
    radius = 0.064 * np.sin(np.pi / 40)
    thin = RvGeometry(pin_radius=radius - 1e-7, eccentricity=0.0003)
    thick = replace(thin, pin_radius=radius + 1e-7)
    assert not any("overlap" in one.message for one in faults(ContactGeometry(thin)))
    assert any("overlap" in one.message for one in faults(ContactGeometry(thick)))
