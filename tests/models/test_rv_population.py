"""Populations of units by the kernel, against the loaded contact, differences and a slow reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.models.kernel_reference import by_arrays
from tests.models.loaded_units import modified_geometry, part_errors
from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact, faults
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, Nominal, PartErrors
from tolevo.models.rv_reducer.geometry import RvGeometry
from tolevo.models.rv_reducer.population import errors as lattice_module
from tolevo.models.rv_reducer.population import units as profile_module
from tolevo.models.rv_reducer.population.contact import NAMES, Population, Slopes, Touch, Turn, pull_back, touch
from tolevo.models.rv_reducer.population.errors import Lattice, Scaled, Table, turn_lattice
from tolevo.models.rv_reducer.population.measures import Conditions, Measure, Measures
from tolevo.models.rv_reducer.population.units import ERRORS, BaseSample, Hierarchy, Involute, UnitDesign, draw_teeth
from tolevo.models.rv_reducer.tighter_planet import TighterPlanet
from tolevo.units import ARCMIN, UM

Array = NDArray[np.float64]
GEOMETRY = ContactGeometry(true_levers=True)
ZONES = {
    "pin_circle_radius": 3.0,
    "pin_position": 2.0,
    "pin_hole_radius": 1.5,
    "pin_radius": 1.0,
    "pitch": 4.0,
    "runout": 1.0,
    "eccentricity": 1.0,
    "equidistance": 1.0,
    "shift": 1.0,
    "crank_bearing": 2.0,
    "circle_offset": 3.0,
    "bore": 2.0,
    "crank_phase": 2.0 / 1.3,
}
MIDS = {
    "pin_circle_radius": -1.0,
    "pin_position": -1.0,
    "pin_hole_radius": 2.5,
    "pin_radius": -1.0,
    "pitch": -3.0,
    "equidistance": -1.0,
    "shift": 1.0,
}
DOCUMENT = UnitDesign(ZONES, MIDS, stagger=0.1)
SPECTRUM = {"one_wave": 0.6, "three_waves": 0.3, "white": 0.5}


def widened(factor: float) -> UnitDesign:
    return replace(DOCUMENT, half_width={name: factor * t for name, t in ZONES.items()})


def touching(lattice: Lattice, sample: BaseSample, design: UnitDesign) -> tuple[Table, Touch, Array]:
    """Table, contacts, and y [arcmin], (positions, units)."""
    table = Table.of(lattice, design.dr_rp, design.dr_p)
    found = touch(lattice, table, Scaled.of(lattice.geometry, sample, design))
    return table, found, found.cycloid(lattice.geometry.output_ratio).astype(float)


def by_contact(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign, angles: Array, exact: bool) -> Array:
    """The same y by the loaded contact, (positions, units)."""
    contact = LoadedContact(modified_geometry(geometry, design), exact=exact)
    errors = part_errors(geometry, sample, design)
    return performance.backlash(contact, errors, angles).T / ARCMIN


# ---------------------------------------------------------------- against the nearest point


@pytest.mark.parametrize(
    ("design", "within", "bias"),
    [(DOCUMENT, 0.001, 0.0004), (widened(2.0), 0.006, 0.0004), (widened(0.5), 0.0004, 0.0004)],
    ids=["document B", "twice", "half"],
)
def test_linear_in_the_errors(design: UnitDesign, within: float, bias: float) -> None:
    """At most 0.002' is asked for at the zones of document B with 3, 2, 2 um between the discs.

    What is left grows with the square of the zones; 0.0002' of its mean is the mid-limit of the
    shift modification, taken to first order.
    """
    sample = BaseSample.draw(GEOMETRY, 64, np.random.default_rng(0))
    lattice = Lattice.of(GEOMETRY, turn_lattice(61, 39))
    _, _, found = touching(lattice, sample, design)
    exact = by_contact(GEOMETRY, sample, design, lattice.angles, exact=True)
    assert np.max(np.abs(found - exact)) < within
    assert abs(np.mean(found - exact)) < bias


def test_a_population_builds_its_units_by_the_law_of_their_errors() -> None:
    """By the errors of unit zones and mid-limits, one design after another; single precision is 1e-7 of 10'."""
    drawn = Population.draw(GEOMETRY, 17, 64, np.random.default_rng(5))
    for design in (
        DOCUMENT,
        widened(2.0),
        replace(DOCUMENT, mid={}),
        replace(DOCUMENT, mid={"pitch": 2.0, "bore": 1.0}),
    ):
        _, _, wanted = touching(drawn.lattice, drawn.sample, design)
        np.testing.assert_allclose(drawn.turn(design).play, wanted, rtol=0.0, atol=5e-6)


def test_part_errors_are_the_same_units() -> None:
    """Each source alone, at 2 um or mrad, moves y alike; second order is below 0.0004'."""
    sample = BaseSample.draw(GEOMETRY, 4, np.random.default_rng(1))
    lattice = Lattice.of(GEOMETRY, turn_lattice(17, 39))
    _, _, still = touching(lattice, sample, UnitDesign({}))
    for name in ERRORS:
        one = UnitDesign({name: 2.0}, {} if name == "crank_bearing" else {name: 0.5})
        one = replace(one, mid={}) if name in {"circle_offset", "bore", "crank_phase"} else one
        _, _, found = touching(lattice, sample, one)
        wanted = by_contact(GEOMETRY, sample, one, lattice.angles, exact=False)
        np.testing.assert_allclose(found, wanted, atol=4e-4, err_msg=name)
        assert np.max(np.abs(found - still)) > 0.01, name


@pytest.mark.parametrize(
    "geometry",
    [
        ContactGeometry(true_levers=True, cranks=3),
        ContactGeometry(true_levers=True, discs=1),
        ContactGeometry(RvGeometry(cycloid_teeth=38, pins=39), true_levers=True, discs=3, cranks=3),
        ContactGeometry(RvGeometry(cycloid_teeth=29, pins=30), true_levers=True),
        ContactGeometry(RvGeometry(0.0825, 0.004, 0.0022, 29, 30, 81.0, 0.012, 0.05), true_levers=True, discs=3),
    ],
    ids=["3 cranks", "1 disc", "38 teeth, 3 discs and cranks", "29 teeth", "larger, 3 discs"],
)
def test_other_geometries(geometry: ContactGeometry) -> None:
    """Perfect units, and units with every error, by the loaded contact.

    Second order is below 0.002' as for the RV-40E; a perfect unit's y is that of both to rounding.
    """
    design = replace(DOCUMENT, dr_p=-80e-6)
    assert not faults(modified_geometry(geometry, design))
    sample = BaseSample.draw(geometry, 16, np.random.default_rng(3))
    angles = turn_lattice(53, geometry.nominal.cycloid_teeth)
    lattice = Lattice.of(geometry, angles)
    perfect = UnitDesign({}, dr_p=-80e-6)
    _, _, found = touching(lattice, sample, perfect)
    contact = LoadedContact(modified_geometry(geometry, perfect))
    y = performance.backlash(contact, PartErrors(), angles)[0] / ARCMIN
    np.testing.assert_allclose(found, np.broadcast_to(y[:, None], found.shape), atol=2e-6)
    _, _, found = touching(lattice, sample, design)
    exact = by_contact(geometry, sample, design, angles, exact=True)
    np.testing.assert_allclose(found, exact, atol=2e-3)


@pytest.mark.parametrize("dr_p", [-120e-6, -70e-6, 0.0, -0.5e-3])
def test_table_is_the_nominal_profile(dr_p: float) -> None:
    """Turns at contact of perfect parts: within 1e-4' from 10 degrees of phase on.

    Nearer to the bottom of a tooth space, where C bends sharply and pins hardly ever touch, the
    polynomial in the shift modification leaves 0.003', or 0.2 % of an overlap.
    """
    lattice = Lattice.of(GEOMETRY, turn_lattice(61, 39))
    table = Table.of(lattice, -40e-6, dr_p)
    nominal = Nominal.at(replace(GEOMETRY, dr_rp=-40e-6, dr_p=dr_p), lattice.phase * lattice.side)
    away = np.degrees(lattice.phase) > 10.0
    turn = nominal.gap / nominal.lever / ARCMIN
    np.testing.assert_allclose(table.values[away, 0], turn[away], rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(table.values[:, 0], turn, rtol=2e-3, atol=3e-3)
    np.testing.assert_allclose(table.arm[away], nominal.lever[away], rtol=1e-4)


@pytest.mark.parametrize("least", [0.1, 0.5, 0.7])
def test_pins_left_out_close_no_backlash(monkeypatch: pytest.MonkeyPatch, least: float) -> None:
    """The same y with pins from 0.1 to 0.7 of the largest lever arm, by the note and here."""
    sample = BaseSample.draw(GEOMETRY, 256, np.random.default_rng(8))
    angles = turn_lattice(61, 39)
    _, _, expected = touching(Lattice.of(GEOMETRY, angles), sample, DOCUMENT)
    for module in (lattice_module, profile_module):
        monkeypatch.setattr(module, "LEAST_LEVER", least)
    fewer = Lattice.of(GEOMETRY, angles)
    _, _, found = touching(fewer, sample, DOCUMENT)
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize("dr_rp", [-80e-6, -40e-6, 0.0])
@pytest.mark.parametrize("dr_p", [-120e-6, -60e-6, 0.0])
def test_every_modification_of_the_range_has_a_value(dr_rp: float, dr_p: float) -> None:
    """Also where the profile interferes, so that a search is led back; better open than closed."""
    sample = BaseSample.draw(GEOMETRY, 16, np.random.default_rng(8))
    lattice = Lattice.of(GEOMETRY, turn_lattice(13, 39))
    design = replace(DOCUMENT, dr_rp=dr_rp, dr_p=dr_p)
    _, _, found = touching(lattice, sample, design)
    assert np.all(np.isfinite(found))
    opened = replace(design, dr_rp=dr_rp + 1e-6)
    assert np.all(touching(lattice, sample, opened)[2] > found)


# ---------------------------------------------------------------- derivatives


def stepped(design: UnitDesign, name: str, step: float) -> UnitDesign:
    """The design with one variable moved, in the units of `NAMES`."""
    if name == "stagger":
        return replace(design, stagger=design.stagger + step)
    if name in ("dr_rp", "dr_p"):
        return replace(design, **{name: getattr(design, name) + 1e-3 * step})
    return replace(design, half_width={**design.half_width, name: design.width(name) + step})


STEPS = {"stagger": 3e-4, "dr_rp": 5e-6, "dr_p": 5e-6}
"""Steps [arcmin, mm]; those of zones are 0.002 um, so that few units change their contacts."""


@pytest.fixture(scope="module")
def drawn() -> tuple[Lattice, BaseSample, Slopes]:
    lattice = Lattice.of(GEOMETRY, turn_lattice(61, 39))
    sample = BaseSample.draw(GEOMETRY, 512, np.random.default_rng(3))
    return lattice, sample, Slopes.of(GEOMETRY, sample)


def weights(y: Array, kind: str) -> Array:
    """Weights of the mean of all, of the greatest over the turn, and of a random sum."""
    found = np.full(y.shape, 1.0 / y.size)
    if kind == "greatest":
        units = np.arange(y.shape[1])
        found[:] = 0.0
        found[np.argmax(y, axis=0), units] = 1.0 / y.shape[1]
    if kind == "random":
        found *= np.random.default_rng(0).uniform(-2.0, 4.0, y.shape)
    return found


@pytest.mark.parametrize("kind", ["mean", "greatest", "random"])
@pytest.mark.parametrize("name", NAMES)
def test_slopes_are_central_differences(drawn: tuple[Lattice, BaseSample, Slopes], name: str, kind: str) -> None:
    """Within 0.5 %, and 0.0003'/um for the units that change their contacts over the step."""
    lattice, sample, slopes = drawn
    table, contacts, y = touching(lattice, sample, DOCUMENT)
    weight = weights(y, kind)
    slope = pull_back(lattice, table, contacts, slopes, weight)[NAMES.index(name)]
    step = STEPS.get(name, 0.002)
    values = []
    for one in (step, -step):
        _, _, moved = touching(lattice, sample, stepped(DOCUMENT, name, one))
        values.append(moved.max(axis=0).mean() if kind == "greatest" else np.sum(weight * moved))
    expected = (values[0] - values[1]) / (2.0 * step)
    assert slope == pytest.approx(expected, rel=5e-3, abs=3e-4)


def test_slopes_of_the_quantile() -> None:
    """q99.73 of phi_1 and the greatest backlash, 1024 units: within 0.5 % from 0.05'/um on.

    Smaller ones within 0.002'/um, as some tens of units make the quantile.
    """
    population = Population.draw(GEOMETRY, 61, 1024, np.random.default_rng(0))
    involute = Involute(0.288, 0.173, TighterPlanet())  # grade 5.5
    design = replace(DOCUMENT, stagger=0.0)

    def measure(one: UnitDesign) -> tuple[Turn, Measure]:
        turn = population.turn(one)
        return turn, Measures(turn, involute, Conditions())["quantile max"]

    turn, of_design = measure(design)
    large = set()
    for name, slope in zip(NAMES, of_design.slopes(turn), strict=True):
        if name == "stagger":
            continue  # at 0 either flank may lead: a kink
        step = 4.0 * STEPS.get(name, 0.002)
        high, low = (measure(stepped(design, name, one))[1].statistic.value for one in (step, -step))
        expected = (high - low) / (2.0 * step)
        if abs(expected) > 0.05:
            large.add(name)
            assert slope == pytest.approx(expected, rel=5e-3), name
        else:
            assert slope == pytest.approx(expected, abs=2e-3), name
    assert large >= {"pin_circle_radius", "crank_bearing", "dr_rp", "dr_p"}


def test_slopes_of_rarer_geometries() -> None:
    """Three discs and cranks: all derivatives of the mean by differences."""
    nominal = RvGeometry(cycloid_teeth=38, pins=39)
    geometry = ContactGeometry(nominal, true_levers=True, discs=3, cranks=3)
    lattice = Lattice.of(geometry, turn_lattice(31, 38))
    sample = BaseSample.draw(geometry, 256, np.random.default_rng(4))
    table, contacts, y = touching(lattice, sample, DOCUMENT)
    weight = weights(y, "mean")
    found = pull_back(lattice, table, contacts, Slopes.of(geometry, sample), weight)
    for name, slope in zip(NAMES, found, strict=True):
        step = 10.0 * STEPS.get(name, 0.002)
        high, low = (touching(lattice, sample, stepped(DOCUMENT, name, one))[2].mean() for one in (step, -step))
        expected = (high - low) / (2.0 * step)
        assert slope == pytest.approx(expected, rel=5e-3, abs=3e-4), name


# ---------------------------------------------------------------- against arrays


@pytest.mark.parametrize("spectrum", [{"one_wave": 1.0}, SPECTRUM], ids=["one wave", "by tooth"])
def test_kernel_and_reference_agree(drawn: tuple[Lattice, BaseSample, Slopes], spectrum: dict[str, float]) -> None:
    """Single precision: 3e-7 of turns of some arc minutes, and of sums of their derivatives."""
    lattice, _, _ = drawn
    laws = Hierarchy(pitch_spectrum=spectrum)
    sample = BaseSample.draw(GEOMETRY, 300, np.random.default_rng(9), laws)  # more than the lanes
    table, compiled, y = touching(lattice, sample, DOCUMENT)
    slopes, weight = Slopes.of(GEOMETRY, sample), weights(y, "random")
    found = pull_back(lattice, table, compiled, slopes, weight)
    with by_arrays():
        _, arrays, plain = touching(lattice, sample, DOCUMENT)
        wanted = pull_back(lattice, table, compiled, slopes, weight)
    np.testing.assert_allclose(y, plain, atol=2e-6)
    same = (compiled.ahead == arrays.ahead) & (compiled.behind == arrays.behind)
    assert np.mean(same) > 0.9999  # ties apart
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6)


# ---------------------------------------------------------------- pitch errors by tooth


def test_teeth_turn_the_pins_that_lie_in_their_spaces() -> None:
    """First contact over all pins by the loaded contact's gaps without pitch errors, each turned by F_p/(2 r_p) times
    the error of the space that its pin lies in, by the pin's angle about the moved axis of the disc.
    """
    lattice, sizes = Lattice.of(GEOMETRY, turn_lattice(13, 39)), Hierarchy(pitch_spectrum=SPECTRUM)
    sample = BaseSample.draw(GEOMETRY, 8, np.random.default_rng(6), sizes)
    assert sample.teeth is not None
    _, _, found = touching(lattice, sample, DOCUMENT)
    smooth = replace(DOCUMENT, half_width=ZONES | {"pitch": 0.0}, mid=MIDS | {"pitch": 0.0})
    contact = LoadedContact(modified_geometry(GEOMETRY, smooth))
    gaps = contact.mesh(part_errors(GEOMETRY, replace(sample, teeth=None), smooth), lattice.angles).gaps
    turn = gaps.gap / np.where(np.abs(gaps.lever) > 1e-4, gaps.lever, np.inf) - gaps.turn[..., None]
    psi = lattice.angles[:, None] + np.array([0.0, np.pi])
    pins = 64e-3 * np.exp(2j * np.pi * np.arange(40) / 40)
    seen = (pins - 1.3e-3 * np.exp(1j * psi)[..., None]) * np.exp(1j * (lattice.angles / 39)[:, None, None])
    seen[:, 1] *= -1.0  # the second disc is turned by half a turn
    space = np.rint(np.angle(seen) * 39 / (2.0 * np.pi)).astype(int) % 39
    cumulative = (MIDS["pitch"] + ZONES["pitch"] * sample.z["pitch"]) * UM  # (discs, units)
    for disc in range(2):
        error = sample.teeth[disc][space[:, disc]] * cumulative[disc]  # (positions, pins, units)
        turn[:, :, disc] += np.moveaxis(error, -1, 0) / (2.0 * 64e-3)
    ahead = np.where(gaps.lever > 1e-4, turn + gaps.play[..., None], np.inf).min(axis=(2, 3))
    behind = np.where(gaps.lever < -1e-4, turn - gaps.play[..., None], -np.inf).max(axis=(2, 3))
    wanted = (ahead - behind).T / ARCMIN / GEOMETRY.output_ratio
    np.testing.assert_allclose(found, wanted, atol=2e-3)
    wave = replace(sample, teeth=None)
    assert np.abs(touching(lattice, wave, DOCUMENT)[2] - found).max() > 0.05, "it matters"


def test_one_wave_by_tooth_is_nearly_the_wave_at_every_pin() -> None:
    """A tooth is displaced as a whole: within half a pitch, 4.6 degrees, of the wave. Off, no bit differs."""
    lattice, rng = Lattice.of(GEOMETRY, turn_lattice(31, 39)), np.random.default_rng
    wave = BaseSample.draw(GEOMETRY, 64, rng(2))
    nearly = Hierarchy(pitch_spectrum={"one_wave": 1.0, "two_waves": 1e-12})
    teeth = BaseSample.draw(GEOMETRY, 64, rng(2), nearly)
    same = BaseSample.draw(GEOMETRY, 64, rng(2), Hierarchy(pitch_spectrum={"one_wave": 1.0}))
    assert same.teeth is None and wave.teeth is None
    np.testing.assert_array_equal(teeth.z["pin_radius"], wave.z["pin_radius"])
    pitch = UnitDesign({"pitch": 4.0})
    first, second, still = (
        touching(lattice, s, d)[2] for s, d in ((wave, pitch), (teeth, pitch), (wave, UnitDesign({})))
    )
    assert np.std(second - first) < 0.04 * np.std(first - still)


def test_teeth_are_drawn_to_the_spectrum() -> None:
    """Fourier components of many discs: amplitude / 2 each, white noise s / sqrt(3) in all of them."""
    phase = 2.0 * np.pi * np.random.default_rng(0).random((2, 4000))
    teeth = draw_teeth({"one_wave": 0.5, "three_waves": 0.2, "white": 0.3}, 39, phase, np.random.default_rng(1))
    power = np.mean(np.abs(np.fft.fft(teeth, axis=1) / 39) ** 2, axis=(0, 2))
    floor = 0.3**2 / 3.0 / 39
    wanted = np.full(39, floor)
    wanted[[1, 38]] += 0.25**2
    wanted[[3, 36]] += 0.1**2
    np.testing.assert_allclose(power, wanted, rtol=0.08)
    alone = draw_teeth({"one_wave": 0.5}, 39, phase, np.random.default_rng(1))
    np.testing.assert_allclose(alone[1, 7], 0.5 * np.cos(2.0 * np.pi * 7 / 39 - phase[1]), rtol=1e-9)


def test_contacts_that_touch_are_those_of_the_gaps() -> None:
    """The pins found ahead and behind close their gaps first, by the loaded contact's own gaps."""
    lattice = Lattice.of(GEOMETRY, turn_lattice(13, 39))
    sample = BaseSample.draw(GEOMETRY, 8, np.random.default_rng(6))
    _, found, _ = touching(lattice, sample, DOCUMENT)
    contact = LoadedContact(modified_geometry(GEOMETRY, DOCUMENT))
    mesh = contact.mesh(part_errors(GEOMETRY, sample, DOCUMENT), lattice.angles)
    gaps = mesh.gaps
    turn = gaps.gap / np.where(np.abs(gaps.lever) > 1e-4, gaps.lever, np.inf)
    forward = turn + gaps.play[..., None] - gaps.turn[..., None]
    forward = np.where(gaps.lever > 1e-4, forward, np.inf).reshape(8, 13, -1)
    pins = lattice.disc[found.ahead] * GEOMETRY.pins + lattice.pin[found.ahead]
    reached = np.take_along_axis(forward, pins.T[..., None], axis=2)[..., 0]
    np.testing.assert_allclose(reached / ARCMIN, forward.min(axis=2) / ARCMIN, atol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_first_of_few_contacts_is_that_of_each_alone(count: int) -> None:
    """Contacts are taken by twos, an odd one twice: the first is the least of those of one contact each."""
    whole = Lattice.of(GEOMETRY, turn_lattice(7, 39))
    sample = BaseSample.draw(GEOMETRY, 300, np.random.default_rng(5))

    def first(skipped: int, taken: int) -> Touch:
        begin = whole.start + skipped
        return touching(replace(whole, start=begin, stop=begin + taken), sample, DOCUMENT)[1]

    together, alone = first(0, count), [first(at, 1) for at in range(count)]
    np.testing.assert_array_equal(together.high, np.min([one.high for one in alone], axis=0))
    np.testing.assert_array_equal(together.low, np.max([one.low for one in alone], axis=0))
    nearest = np.argmin([one.high for one in alone], axis=0)
    np.testing.assert_array_equal(together.ahead, np.choose(nearest, [one.ahead for one in alone]))


def test_units_are_the_same_however_many_are_drawn_at_once() -> None:
    """A part of the sample gives the same units."""
    lattice = Lattice.of(GEOMETRY, turn_lattice(7, 39))
    sample = BaseSample.draw(GEOMETRY, 300, np.random.default_rng(2))
    _, _, whole = touching(lattice, sample, DOCUMENT)
    _, _, part = touching(lattice, sample.part(slice(250, 270)), DOCUMENT)
    np.testing.assert_allclose(part, whole[:, 250:270], atol=1e-6)


def test_bearing_play_and_stagger_in_closed_form() -> None:
    """Clearance c in both bearings of both discs: c/a_0; two discs turned apart by 2 s: -2 s."""
    lattice = Lattice.of(GEOMETRY, turn_lattice(11, 39))
    sample = BaseSample.draw(GEOMETRY, 3, np.random.default_rng(2))
    sample.z["crank_bearing"][:] = 1.0
    _, _, still = touching(lattice, sample, UnitDesign({}))
    _, _, loose = touching(lattice, sample, UnitDesign({"crank_bearing": 5.0}))
    ratio, a_0 = GEOMETRY.output_ratio, GEOMETRY.nominal.centre_distance
    np.testing.assert_allclose(loose - still, 5.0 * UM / a_0 / ARCMIN / ratio, atol=2e-6)
    _, _, turned = touching(lattice, sample, UnitDesign({}, stagger=0.25))
    np.testing.assert_allclose(turned - still, -0.5 / ratio, atol=2e-6)
