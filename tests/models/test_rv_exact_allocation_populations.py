"""Section 7 of the note on allocation by the exact contact: populations of units.

Its figures hold with true lever arms, at 61 positions of the turn where not said otherwise, and
with phi_1 without the cosine of the pressure angle. Its stagger delta' is half the turn of a disc.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.hermite_e import hermegauss
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from tests.models.loaded_units import modified_geometry, part_errors
from tests.models.test_rv_exact_allocation import cycloid
from tests.models.test_rv_population import MIDS, ZONES
from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry
from tolevo.models.rv_reducer.population.errors import nearest_prime, spreads_evenly, turn_lattice
from tolevo.models.rv_reducer.population.units import BaseSample, UnitDesign
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
GEOMETRY = ContactGeometry(true_levers=True)

DOCUMENT = {name: t for name, t in ZONES.items() if name not in ("circle_offset", "bore", "crank_phase")}
BETWEEN_DISCS = {"circle_offset": 3.0, "bore": 2.0, "crank_phase": 2.0 / 1.3}
DOCUMENT_B = UnitDesign(DOCUMENT, MIDS)


def allocated(tolerances: tuple[float, ...], dr_rp_mm: float, dr_p_mm: float) -> UnitDesign:
    """A design of grade 4 in the order of `DOCUMENT`, without stagger."""
    zones = dict(zip(DOCUMENT, tolerances, strict=True))
    dr_rp, dr_p = 1e-3 * dr_rp_mm, 1e-3 * dr_p_mm
    return UnitDesign(zones, MIDS, involute_grade=4.0, dr_rp=dr_rp, dr_p=dr_p)


LEAST_COST = replace(
    allocated((1.427, 1.123, 1.080, 0.496, 2.566, 1.505, 4.849, 0.665, 0.939, 0.834), -0.03874, -0.0814),
    stagger=2.0 * 0.1961,
)
"""The least cost of the document's model, as version 0.1 found it: 18.08."""
EQUAL = allocated((1.423, 1.275, 1.092, 0.469, 2.430, 1.454, 4.683, 0.618, 0.882, 0.839), -0.0474, -0.0863)
"""Its equal by that model at stagger 0 (note on proofs, section 4)."""
OPTIMUM = allocated((1.49, 2.94, 2.38, 1.53, 5.4, 3.1, 2.6, 0.75, 1.01, 2.4), -0.0373, -0.0673)
"""The optimum by contact, cost 12.40, to the digits that the note prints."""


def with_errors_between_discs(design: UnitDesign) -> UnitDesign:
    return replace(design, half_width={**design.half_width, **BETWEEN_DISCS})


GRADE_7 = (0.484, 0.291)
"""Mid value and half-width of a planet's clearance [arcmin] at grade 7."""


def involute_zone(grade: float) -> tuple[float, float]:
    middle, half = (2.0 ** ((grade - 7.0) / 2.0) * one for one in GRADE_7)
    return middle, half


def involute(sample: BaseSample, grade: float) -> Array:
    """phi_1 [arcmin] of each unit: the tighter of the planets, which share half their variance."""
    middle, half = involute_zone(grade)
    normal = np.sqrt(0.5) * (sample.planets[0] + sample.planets[1:])
    return np.asarray(middle + half * (2.0 * ndtr(normal) - 1.0).min(axis=0))


def share_within(limit: float, greatest: Array, grade: float) -> float:
    """Share of units with phi_1 + max(0, y) <= limit, phi_1 integrated over both planets."""
    middle, half = involute_zone(grade)
    z = (limit - np.maximum(0.0, greatest) - middle) / half
    common, weight = hermegauss(64)
    normal = ndtri(np.clip(0.5 * (z + 1.0), 1e-300, 1.0))[:, None]
    looser = ndtr(np.sqrt(2.0) * (np.sqrt(0.5) * common - normal))  # of one planet, given `common`
    within = 1.0 - looser**2 @ weight / weight.sum()
    return float(np.mean(np.where(z < 1.0, np.where(z > -1.0, within, 0.0), 1.0)))


def quantile(greatest: Array, grade: float, coverage: float = 0.9973) -> float:
    """The backlash [arcmin] that `coverage` of the units keep."""
    limit = brentq(lambda at: share_within(at, greatest, grade) - coverage, 0.0, 5.0, xtol=1e-6)
    return float(limit)


def units(design: UnitDesign, count: int, positions: int) -> tuple[BaseSample, Array]:
    """Units of a design, and their y [arcmin], (positions, units)."""
    sample = BaseSample.draw(GEOMETRY, count, np.random.default_rng(5))
    return sample, cycloid(design, sample, turn_lattice(positions, 39))


def test_document_b() -> None:
    """Mean and standard deviation of y between units, q of the maximum over 61 positions."""
    _, y = units(DOCUMENT_B, 4096, 61)
    assert y.mean() == pytest.approx(0.150, abs=0.001)
    assert y.mean(axis=0).std() == pytest.approx(0.155, abs=0.003)
    assert quantile(y.max(axis=0), 7.0) == pytest.approx(1.386, abs=0.01)  # three standard errors


@pytest.mark.parametrize(
    ("design", "within", "give", "interfering"),
    [
        (DOCUMENT_B, 81.8, 0.5, 0.20),
        (with_errors_between_discs(DOCUMENT_B), 84.8, 0.5, 0.39),
        (replace(DOCUMENT_B, stagger=0.2), 95.4, 0.5, 0.73),
        (LEAST_COST, 42.6, 1.5, 0.0),
        (with_errors_between_discs(LEAST_COST), 16.8, 1.5, 0.0),
        (EQUAL, 98.9, 0.3, 0.0),
        (with_errors_between_discs(EQUAL), 99.2, 0.2, 0.01),
        (OPTIMUM, 99.71, 0.1, 0.046),
    ],
)
def test_share_within_1_arcmin(design: UnitDesign, within: float, give: float, interfering: float) -> None:
    """Percent of units within 1' at 61 positions, and the share whose turn mean interferes.

    Three standard errors of 4096 units, more where the note's own sample adds to them.
    """
    sample, y = units(design, 4096, 61)
    share = share_within(1.0, y.max(axis=0), design.involute_grade)
    assert 100.0 * share == pytest.approx(within, abs=give)
    assert np.mean(y.mean(axis=0) < 0.0) == pytest.approx(interfering, abs=0.012)
    drawn = involute(sample, design.involute_grade) + np.maximum(0.0, y.max(axis=0))
    error = np.sqrt(share * (1.0 - share) / 4096.0)
    assert np.mean(drawn <= 1.0) == pytest.approx(share, abs=4.0 * error)


@pytest.mark.parametrize(
    ("design", "over_61", "over_1021"),
    [
        (DOCUMENT_B, 1.386, 1.432),
        (with_errors_between_discs(DOCUMENT_B), 1.359, 1.412),
        (replace(DOCUMENT_B, stagger=0.2), 1.221, 1.273),
        (LEAST_COST, 1.615, 1.675),
        (with_errors_between_discs(LEAST_COST), 1.714, 1.762),
        (OPTIMUM, 1.003, 1.056),
    ],
)
def test_quantile_over_part_of_the_turn_and_all_of_it(design: UnitDesign, over_61: float, over_1021: float) -> None:
    """1024 units here, 4096 in the note: their standard errors are 0.02' and 0.01'.

    16,384 units have 1.597' and 1.652' for the least cost of the document's model, 0.996' and
    1.056' for the optimum.
    """
    _, y = units(design, 1024, 1021)
    assert quantile(y.max(axis=0), design.involute_grade) == pytest.approx(over_1021, abs=0.05)
    _, y = units(design, 4096, 61)
    assert quantile(y.max(axis=0), design.involute_grade) == pytest.approx(over_61, abs=0.03)


@pytest.fixture(scope="module")
def whole_turn() -> tuple[BaseSample, Array]:
    """Units of document B with errors between the discs at 4097 positions: the greatest y."""
    sample, y = units(with_errors_between_discs(DOCUMENT_B), 256, 4097)
    return sample, y.max(axis=0)


@pytest.mark.parametrize(
    ("positions", "bias"),
    [(16, -0.12), (31, -0.085), (61, -0.065), (127, -0.049), (251, -0.026), (503, -0.020),
     (1021, -0.009)],
)  # fmt: skip
def test_greatest_over_few_positions(whole_turn: tuple[BaseSample, Array], positions: int, bias: float) -> None:
    """Against 4097 positions; the standard error of the mean over 256 units is 0.003'."""
    sample, greatest = whole_turn
    y = cycloid(with_errors_between_discs(DOCUMENT_B), sample, turn_lattice(positions, 39))
    assert np.mean(y.max(axis=0) - greatest) == pytest.approx(bias, abs=0.01)


@pytest.mark.parametrize(("positions", "bias", "good"), [(156, -0.10, 151), (312, -0.07, 317), (157, -0.06, 163)])
def test_positions_that_do_not_spread_miss_the_greatest(
    whole_turn: tuple[BaseSample, Array], positions: int, bias: float, good: int
) -> None:
    """By the note 156 and 312 share a factor with the teeth; 157 is one more than four times 39."""
    sample, greatest = whole_turn
    assert not spreads_evenly(positions, GEOMETRY)
    assert nearest_prime(positions, GEOMETRY) == good
    design = with_errors_between_discs(DOCUMENT_B)
    poor, even = (cycloid(design, sample, turn_lattice(count, 39)).max(axis=0) for count in (positions, good))
    assert np.mean(poor - greatest) == pytest.approx(bias, abs=0.01)
    assert np.mean(even - greatest) > -0.04


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("pin_circle_radius", 0.059, 0.066),  # 0.062 in the note
        ("equidistance", 0.035, 0.060),  # 0.056
        ("crank_bearing", 0.048, 0.057),  # 0.053
        ("pitch", 0.003, 0.012),  # 0.010
        ("pin_position", -0.022, 0.005),  # 0.001
        ("pin_hole_radius", -0.027, 0.003),  # -0.022
        ("pin_radius", -0.022, 0.005),  # 0.003
    ],
)
def test_quantile_by_zone(name: str, least: float, most: float) -> None:
    """dq/dt [arcmin/um] at document B's zones with errors between the discs, grade 5.5.

    By differences over a tenth of a zone; samples of 4096 units differ by 0.001' to 0.004'/um, as
    some 50 units make the quantile. Scatter of the pins closes a unit: their zones lower q if
    anything, and interference alone limits them.
    """
    design = replace(with_errors_between_discs(DOCUMENT_B), involute_grade=5.5)
    step = 0.1 * design.width(name)
    q = []
    for zone in (design.width(name) + step, design.width(name) - step):
        _, y = units(replace(design, half_width={**design.half_width, name: zone}), 4096, 61)
        q.append(quantile(y.max(axis=0), 5.5))
    assert least < (q[0] - q[1]) / (2.0 * step) < most


FINEST = (0.5, 0.5, 0.5, 0.25, 1.0, 0.25, 0.25, 0.25, 0.25, 0.5)
"""The lower bounds of all tolerances."""


@pytest.mark.parametrize(
    ("design", "limits"),
    [
        (allocated(FINEST, -0.04077, -0.07), (0.88, 1.03, 1.25)),  # no modification left
        (
            with_errors_between_discs(allocated(FINEST, -0.03987, -0.07)),  # P(mean < 0) = 5 %
            (0.97, 1.12, 1.34),
        ),
    ],
    ids=["none between discs", "3, 2, 2 um"],
)
def test_least_lost_motion(design: UnitDesign, limits: tuple[float, ...]) -> None:
    """q of the turn mean at +-3 % of rated torque, phi_1 of grades 5, 6 and 7 included.

    512 units; sampling is 0.003', the note does not print its modifications.
    """
    sample = BaseSample.draw(GEOMETRY, 512, np.random.default_rng(5))
    contact = LoadedContact(modified_geometry(GEOMETRY, design))
    errors, angles = part_errors(GEOMETRY, sample, design), turn_lattice(61, 39)
    torque = performance.LOST_MOTION_SHARE * contact.rated_torque
    ends = [contact.rotation(errors, angles, one).mean(axis=1) for one in (torque, -torque)]
    cycloid_stage = (ends[0] - ends[1]) / ARCMIN
    found = [quantile(cycloid_stage, grade) for grade in (5.0, 6.0, 7.0)]
    np.testing.assert_allclose(found, limits, atol=0.01)
