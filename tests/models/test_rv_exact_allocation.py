"""Section 7 of the note on allocation by the exact contact: single units.

Its figures hold with true lever arms and 1021 positions of the turn. Its stagger delta' is half the
turn of a disc.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from tests.models.loaded_units import modified_geometry, part_errors
from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry
from tolevo.models.rv_reducer.population.contact import touch
from tolevo.models.rv_reducer.population.errors import Lattice, Scaled, Table, turn_lattice
from tolevo.models.rv_reducer.population.units import ERRORS, BaseSample, UnitDesign
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
GEOMETRY = ContactGeometry(true_levers=True)
TURN = turn_lattice(1021, 39)
SECOND = np.array([[0.0, 1.0], [0.0, 1.0]])[:, :, None]  # disc 2 alone, at both cranks

ROWS: Mapping[str, Mapping[str, ArrayLike]] = {
    "zero": {},
    "circle radius +1": {"pin_circle_radius": 1.0},
    "pins +1": {"pin_radius": 1.0},
    "holes +1": {"pin_hole_radius": 1.0},
    "equidistance +1": {"equidistance": 1.0},
    "shift +1": {"shift": 1.0},
    "tangential 5": {"pin_position": 5.0},
    "pitch 10": {"pitch": 10.0},
    "eccentricity +5": {"eccentricity": 5.0},
    "eccentricity +5, disc 2": {"eccentricity": 5.0 * SECOND},
    "eccentricity -5": {"eccentricity": -5.0},
    "bearing 2": {"crank_bearing": 3.0},
    "bores of disc 2": {"bore_tangential": SECOND},
    "journals of disc 2": {"crank_phase": SECOND},
    "circle offset 5": {"circle_offset": 5.0},
}
"""Deviations [um, mrad] by row of the note; a bearing at z has the clearance (1 + z)/2 um."""
UNIT_ZONES = UnitDesign(dict.fromkeys(ERRORS, 1.0))


def perfect(units: int) -> BaseSample:
    """Units without deviation: everything at its mid-limit, bearings without clearance."""
    drawn = BaseSample.draw(GEOMETRY, units, np.random.default_rng(0))
    z = {name: np.zeros_like(value) for name, value in drawn.z.items()}
    z["crank_bearing"] -= 1.0
    phase = {name: np.zeros_like(value) for name, value in drawn.phase.items()}
    return replace(drawn, z=z, phase=phase)


def units_of_rows() -> BaseSample:
    """A unit for each row."""
    sample = perfect(len(ROWS))
    for at, row in enumerate(ROWS.values()):
        for name, amount in row.items():
            sample.z[name][..., at] = np.broadcast_to(amount, (*np.shape(amount)[:-1], 1))[..., 0]
    return sample


def cycloid(design: UnitDesign, sample: BaseSample, angles: Array) -> Array:
    """y [arcmin], (positions, units), by the kernel."""
    lattice = Lattice.of(GEOMETRY, angles)
    table = Table.of(lattice, design.dr_rp, design.dr_p)
    found = touch(lattice, table, Scaled.of(GEOMETRY, sample, design))
    return found.cycloid(GEOMETRY.output_ratio).astype(float)


def by_nearest_point(design: UnitDesign, sample: BaseSample, angles: Array) -> Array:
    """y [arcmin], (positions, units), by the exact nearest point of every pin."""
    contact = LoadedContact(modified_geometry(GEOMETRY, design), exact=True)
    errors = part_errors(GEOMETRY, sample, design)
    return performance.backlash(contact, errors, angles).T / ARCMIN


@pytest.fixture(scope="module")
def rows() -> dict[str, Array]:
    """y over the turn of each row."""
    found = cycloid(UNIT_ZONES, units_of_rows(), TURN)
    return dict(zip(ROWS, found.T, strict=True))


def test_zero_errors(rows: Mapping[str, Array]) -> None:
    zero = rows["zero"]
    found = [zero.mean(), zero.min(), zero.max()]
    np.testing.assert_allclose(found, [0.1118, 0.1079, 0.1170], atol=5e-5)  # as printed


@pytest.mark.parametrize(
    ("row", "change"),
    [
        ("circle radius +1", 0.0767),
        ("pins +1", -0.1313),
        ("holes +1", 0.1313),
        ("equidistance +1", 0.1313),
        ("shift +1", -0.0767),
        ("tangential 5", 0.0),
        ("eccentricity +5", -0.0388),
        ("eccentricity +5, disc 2", -0.0388),
        ("eccentricity -5", -0.0024),
        ("bearing 2", 0.1847),
        ("bores of disc 2", -0.0923),
        ("journals of disc 2", -0.0852),
    ],
)
def test_change_of_the_turn_mean(rows: Mapping[str, Array], row: str, change: float) -> None:
    assert rows[row].mean() - rows["zero"].mean() == pytest.approx(change, abs=5e-5)  # as printed


@pytest.mark.parametrize(
    ("row", "mean", "least", "most"), [("pitch 10", -0.007, -0.305, 0.296), ("circle offset 5", -0.428, -0.657, -0.033)]
)
def test_change_of_mean_and_extremes(
    rows: Mapping[str, Array], row: str, mean: float, least: float, most: float
) -> None:
    """The note's extremes are those of the turn against those of the perfect unit's turn."""
    moved, zero = rows[row], rows["zero"]
    found = [(f(moved) - f(zero)) for f in (np.mean, np.min, np.max)]
    np.testing.assert_allclose(found, [mean, least, most], atol=5e-4)  # as printed


def test_stagger() -> None:
    """0.1' of the note's delta' is 0.2' of turn of each disc."""
    still = cycloid(UNIT_ZONES, perfect(1), TURN).mean()
    moved = cycloid(replace(UNIT_ZONES, stagger=0.2), perfect(1), TURN).mean()
    assert moved - still == pytest.approx(-0.3868, abs=5e-5)


def test_every_row_by_the_exact_nearest_point(rows: Mapping[str, Array]) -> None:
    """Terms of second order are below 0.0005' at deviations of up to 10 um."""
    angles = TURN[::10]
    exact = by_nearest_point(UNIT_ZONES, units_of_rows(), angles)
    found = np.stack(list(rows.values()), axis=1)[::10]
    np.testing.assert_allclose(found, exact, atol=5e-4)


def test_pins_of_independent_radius() -> None:
    """Standard deviation 1 um; the note's tolerances are those of its few hundred units."""
    sample = perfect(1024)
    sample.z["pin_radius"][:] = np.random.default_rng(2).standard_normal((40, 1024))
    found = cycloid(UNIT_ZONES, sample, TURN)
    assert found.mean() == pytest.approx(-0.004, abs=0.004)
    assert np.mean(found < 0.0) == pytest.approx(0.51, abs=0.02)
    assert found.max(axis=0).mean() == pytest.approx(0.117, abs=0.004)
