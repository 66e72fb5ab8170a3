"""Units by contact against the allocation problem, the exact contact, and changes of parts."""

import tracemalloc

import numpy as np
import pytest

from tests.models.loaded_units import modified_geometry, part_errors
from tolevo.models.inputs import Normal
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.models.rv_reducer.contact import contact as performance
from tolevo.models.rv_reducer.contact.contact import LoadedContact
from tolevo.models.rv_reducer.population.errors import turn_lattice
from tolevo.models.rv_reducer.population.units import BaseSample
from tolevo.problems.rv_reducer import RvReducer
from tolevo.units import ARCMIN

UNITS = 8192
LIMIT = 5.0
"""Standard errors allowed: one seed in about two million is further off."""
BACKLASH = "backlash_arcmin"
Values = dict[str, float | str | bool]


def units(model: RvBatch, count: int = UNITS, seed: int = 3, **columns: object) -> np.ndarray:
    table = {"unit": np.arange(count), **{k: np.asarray(v) for k, v in columns.items()}}
    return model.predict(table, np.random.default_rng(seed))[BACKLASH]


def problems(measured: str) -> dict[str, float]:
    """What the allocation problem says of document B's zones."""
    problem = RvReducer()
    design = problem.references()["document B"]
    names = [f"backlash_{measured}_arcmin{part}" for part in ("", "_mean", "_std")]
    found = problem.evaluation(design, searching=False)
    yields = {"yield": found.value("yield_percent") / 100.0}
    return dict(zip(("quantile", "mean", "std"), map(found.value, names), strict=True)) | yields


@pytest.mark.parametrize("measured", ["max", "mean"])
def test_units_are_those_of_the_problem(measured: str) -> None:
    """Drawn one by one, and as the problem has them: scrambled Sobol, phi_1 integrated."""
    drawn, wanted = units(RvBatch({"measured": measured})), problems(measured)
    error = wanted["std"] / np.sqrt(UNITS)
    assert abs(drawn.mean() - wanted["mean"]) < LIMIT * error + 0.002  # the problem's own error
    assert drawn.std() == pytest.approx(wanted["std"], rel=LIMIT / np.sqrt(UNITS))
    share = np.mean(drawn <= wanted["quantile"])
    assert abs(share - 0.9973) < LIMIT * np.sqrt(0.9973 * 0.0027 / UNITS)
    if measured == "max":
        assert np.mean(drawn <= 1.0) == pytest.approx(wanted["yield"], abs=LIMIT * 0.0045)


def test_yield_of_document_b_of_section_4() -> None:
    """84.8 +- 1 % within 1' with 3, 2, 2 um from disc to disc, phi_1 without the cosine."""
    within = units(RvBatch({"involute_cosine": False})) <= 1.0
    error = np.sqrt(0.848 * 0.152 / UNITS)
    assert np.mean(within) == pytest.approx(0.848, abs=0.01 + 2.0 * error)


def test_law_and_means_are_those_of_the_units() -> None:
    model = RvBatch({"share_pins": 0.3}, inputs={"pin_hole_radius_um": Normal(1.0)})
    drawn, law = units(model), model.law_sample()[BACKLASH]
    error = LIMIT * drawn.std() / np.sqrt(UNITS)
    assert abs(drawn.mean() - model.means()[BACKLASH]) < error
    assert abs(law.mean() - model.means()[BACKLASH]) < 0.004  # two Sobol samples
    assert law.std() == pytest.approx(drawn.std(), rel=LIMIT / np.sqrt(UNITS))
    for share in (0.05, 0.5, 0.95):
        below = np.mean(drawn <= np.quantile(law, share))
        assert abs(below - share) < LIMIT * np.sqrt(share * (1.0 - share) / UNITS)


def test_units_by_the_exact_nearest_point() -> None:
    """The same units in the loaded contact's exact gaps; linear gaps are within 0.002'."""
    model = RvBatch({"involute_stage": False, "positions": 31})
    assert model.contact is not None
    basis, design = model.contact.basis, model.contact.design
    sample = BaseSample.draw(basis.geometry, 16, np.random.default_rng(3), basis.hierarchy, "random")
    contact = LoadedContact(modified_geometry(basis.geometry, design), exact=True)
    errors = part_errors(basis.geometry, sample, design)
    play = performance.backlash(contact, errors, turn_lattice(31, 39)) / ARCMIN
    wanted = np.maximum(play.max(axis=1), 0.0)
    np.testing.assert_allclose(units(model, 16), wanted, rtol=0.0, atol=0.002)


def test_units_are_the_same_however_many_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    model = RvBatch({"positions": 7})
    many = units(model, 300)
    monkeypatch.setattr("tolevo.models.rv_reducer.batch.BLOCK", 64)
    np.testing.assert_array_equal(units(model, 100), many[:100])


def test_rows_of_a_unit_at_angles_hold_its_largest_backlash() -> None:
    """At the positions of the turn, a unit's largest reading is what it shows over the turn."""
    model, positions, count = RvBatch({"positions": 5}), 5, 40
    angles = np.rad2deg(turn_lattice(positions, 39)) / 39.0
    table = {"unit": np.repeat(np.arange(count), positions), "output_angle_deg": np.tile(angles, count)}
    read = model.predict(table, np.random.default_rng(3))[BACKLASH].reshape(count, positions)
    np.testing.assert_allclose(read.max(axis=1), units(model, count), rtol=0.0, atol=1e-5)
    mean = units(RvBatch({"positions": 5, "measured": "mean"}), count)
    np.testing.assert_allclose(read.mean(axis=1), mean, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("error", ["pin_circle_radius", "pin_radius", "runout", "pitch", "shift"])
def test_change_of_an_error_is_that_of_its_mid_limit(error: str) -> None:
    default = next(p.default for p in RvBatch.parameters if p.name == f"{error}_mid_um")
    moved = RvBatch({f"{error}_mid_um": float(str(default)) + 2.0, "positions": 7})
    model, table = RvBatch({"positions": 7}), {"unit": np.arange(200)}
    by = {f"{error}_um": np.full(200, 2.0)}
    found = model.predict(table, np.random.default_rng(3), by)[BACKLASH]
    np.testing.assert_allclose(found, units(moved, 200), rtol=0.0, atol=1e-4)  # single precision


def test_change_of_each_row_is_its_own() -> None:
    model, table = RvBatch({"positions": 7}), {"unit": np.arange(6)}
    by = np.array([0.0, 0.0, 3.0, 0.0, -3.0, 0.0])
    found = model.predict(table, np.random.default_rng(3), {"pin_circle_radius_um": by})[BACKLASH]
    plain = units(model, 6)
    assert np.array_equal(found[by == 0.0], plain[by == 0.0])
    assert found[2] > plain[2]
    assert found[4] <= plain[4]


def test_warm_disc_closes_the_turn_mean_by_the_note() -> None:
    """11.5e-6 x 64 mm = 0.736 um/K of 0.0767'/um (section 7): 0.0564'/K while a turn has play."""
    wide: Values = {"pin_circle_radius_mid_um": 60.0, "measured": "mean"}
    model, table = RvBatch(wide), {"unit": np.arange(100)}
    rise = np.full(100, 2.0)
    warm = model.predict(table, np.random.default_rng(3), {"disc_temperature_K": rise})[BACKLASH]
    change = (warm - units(model, 100)).mean() / 2.0
    assert change == pytest.approx(-0.736 * 0.0767, rel=0.03)  # 60 um wide, other pins touch
    both = {"disc_temperature_K": rise, "housing_temperature_K": rise}
    same = model.predict(table, np.random.default_rng(3), both)[BACKLASH]
    np.testing.assert_allclose(same, units(model, 100), rtol=0.0, atol=1e-4)


def test_memory_does_not_grow_with_the_units() -> None:
    """Blocks of 4096 units: eight of them need no more than two that are there at once."""
    model, peaks = RvBatch({"positions": 3}), []
    units(model, 10)
    for count in (4096, 8 * 4096):
        tracemalloc.start()
        units(model, count)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2.0 * peaks[0]


def test_widened_input_is_that_of_a_wider_zone() -> None:
    model = RvBatch()
    sources = model.sources()
    assert sources.widened is not None
    assert sources.basis
    circle = next(one for one in sources.inputs if one.name == "pin_circle_radius_um")
    term = sources.widened(circle, 2.0)
    wide = RvBatch({"involute_stage": False}, {"pin_circle_radius_um": 6.0})
    drawn = units(wide)
    error = LIMIT * drawn.std() / np.sqrt(2048)
    law = np.maximum(np.asarray(term.distribution.quantile(np.linspace(0.0, 1.0, 4001))), 0.0)
    assert abs(law.mean() - drawn.mean()) < error
    assert law.std() == pytest.approx(drawn.std(), rel=0.05)
    assert circle.per_unit == pytest.approx(0.0767, rel=0.05)  # section 7, of the turn mean
