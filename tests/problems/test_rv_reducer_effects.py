"""Effects in the allocation by contact, against units drawn one by one and differences."""

from dataclasses import replace

import numpy as np
import pytest

from tolevo import registry
from tolevo.errors import ModelError
from tolevo.models.effects.measurements import Active, predicted
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.rv_backlash.counterparts import COUNTERPARTS as DOCUMENTS
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.counterparts import COUNTERPARTS
from tolevo.problems.rv_reducer.declared import MEASURES
from tolevo.problems.settings import Bound, Settings, VariableSetting

UNITS = 16_384
LIMIT = 5.0
"""Standard errors allowed."""
EFFECTS: dict[str, dict[str, float]] = {
    "differential_thermal_expansion": {"temperature_difference_K": -4.0},
    "spread_inflation": {"growth": 0.6},
    "process_mean_shift": {"shift_arcmin": -0.15},
}
SMALL: dict[str, float] = {"report_units": 2048, "search_units": 256, "search_positions": 31}


def active(name: str, **values: float) -> Active:
    return Active(registry.load("effects", name)(), values or EFFECTS[name])


def problem(*effects: Active, **parameters: float) -> RvReducer:
    limits = {"yield_percent": Bound(low=50.0)}
    objectives = ("cost", "backlash_max_arcmin", "backlash_rms_arcmin", "backlash_mean_arcmin_std",
                  "interference_probability", "interference_share_of_turn")  # fmt: skip
    return RvReducer(Settings(
        effects=effects, parameters=SMALL | parameters, limits=limits, objectives=objectives
    ))  # fmt: skip


def outputs(*effects: Active) -> dict[str, float]:
    found = problem(*effects, report_units=4096)
    evaluation = found.evaluation(found.references()["document B"], searching=False)
    names = ("backlash_max_arcmin", "backlash_max_arcmin_mean", "backlash_max_arcmin_std",
             "yield_percent", "interference_probability", "backlash_rms_arcmin")  # fmt: skip
    return {name: evaluation.value(name) for name in names}


def test_every_counterpart_of_the_closed_form_is_here() -> None:
    assert set(COUNTERPARTS) == set(DOCUMENTS)


@pytest.mark.parametrize("names", [["differential_thermal_expansion"], list(EFFECTS)])
def test_units_drawn_with_the_effects(names: list[str]) -> None:
    """The same effects in the units of a batch: changed one by one before interference is cut."""
    effects = [active(name) for name in names]
    table, rng = {"unit": np.arange(UNITS)}, np.random.default_rng(8)
    drawn = predicted(RvBatch(), "rv_batch", table, effects, rng)["backlash_arcmin"]
    found = outputs(*effects)
    std = found["backlash_max_arcmin_std"]
    error = LIMIT * std / np.sqrt(UNITS) + 0.003  # and that of the problem's 4096 units
    assert abs(drawn.mean() - found["backlash_max_arcmin_mean"]) < error
    assert drawn.std() == pytest.approx(std, rel=LIMIT / np.sqrt(UNITS))
    within = np.mean(drawn <= 1.0)
    assert 100.0 * within == pytest.approx(found["yield_percent"], abs=LIMIT * 0.39)
    below = np.mean(drawn <= found["backlash_max_arcmin"])
    assert abs(below - 0.9973) < LIMIT * np.sqrt(0.9973 * 0.0027 / UNITS)


def test_warm_disc_is_a_smaller_pin_circle() -> None:
    """11.5e-6 x 64 mm = 0.736 um/K beside the discs, the same as a mid-limit that much lower."""
    warm = problem(active("differential_thermal_expansion", temperature_difference_K=2.0))
    mid = VariableSetting(mid=-1.0 - 2.0 * 0.736)
    given = replace(problem().given, variables={"pin_circle_radius_um": mid})
    moved = RvReducer(given)
    design = warm.references()["document B"]
    for name in ("backlash_max_arcmin", "interference_probability"):
        one, other = (p.evaluation(design, searching=True).value(name) for p in (warm, moved))
        assert one == pytest.approx(other, rel=1e-6), name
    assert "by -1.472 um" in warm.counterparts()[0]


def test_gap_adds_both_of_its_halves() -> None:
    plain = outputs()
    for name in ("lost_motion", "bearing_clearance"):
        found = outputs(active(name, half_width_arcmin=0.2))
        for key in ("backlash_max_arcmin", "backlash_max_arcmin_mean"):
            assert found[key] == pytest.approx(plain[key] + 0.4, rel=1e-9), key
        for key in ("backlash_max_arcmin_std", "interference_probability"):
            assert found[key] == pytest.approx(plain[key], rel=1e-9), key


def test_clearance_of_the_bearings_acts_inside_the_contact() -> None:
    """It turns every disc by u/a_0 more, 117/121 of it at the carrier: 2 um are 0.1847'."""
    plain = problem()
    design = plain.references()["document B"]
    wider = problem(active("bearing_clearance", bearing_clearance_um=2.0))
    turns = [p.evaluation(design, searching=True).turn.play for p in (plain, wider)]
    np.testing.assert_allclose(turns[1] - turns[0], 0.1847, rtol=0.0, atol=1e-4)
    assert "2 um more clearance" in wider.counterparts()[0]


@pytest.mark.parametrize("name", ["equidistance_um", "pin_circle_radius_um", "involute_grade"])
def test_gradient_with_effects_is_that_of_differences(name: str) -> None:
    """1.5 %: the active pins change over a step."""
    found = problem(*(active(one) for one in EFFECTS))
    design = found.references()["document B"][None, :]
    slopes, at = found.gradient(design), found.names.index(name)
    step, ends = 0.02, []
    for way in (-step, step):
        moved = design[0].copy()
        moved[at] += way
        ends.append(found.evaluation(moved, searching=True))
    for output in ("backlash_max_arcmin", "backlash_rms_arcmin", "backlash_mean_arcmin_std",
                   "interference_probability", "interference_share_of_turn"):  # fmt: skip
        slope = (ends[1].value(output) - ends[0].value(output)) / (2.0 * step)
        assert slopes[output][0, at] == pytest.approx(slope, rel=0.015, abs=5e-4), output
    low, high = (one.value("yield_percent") for one in ends)
    assert slopes["yield_percent"][0, at] == pytest.approx((high - low) / (2.0 * step), abs=0.2)


@pytest.mark.parametrize("effects", [{"process_mean_shift": 0.1}, {"process_mean_shift": -0.1},
                                     {"spread_inflation": 0.3}, {"lost_motion": 0.1},
                                     {"spread_inflation": 0.2, "process_mean_shift": 0.05}])  # fmt: skip
def test_overlap_and_interference_are_those_of_the_changed_units(effects: dict[str, float]) -> None:
    """Counted on y' = m + s + (1 + g)(y - m); a gap elsewhere moves no flank."""
    keys = {"process_mean_shift": "shift_arcmin", "spread_inflation": "growth", "lost_motion": "half_width_arcmin"}
    found = problem(*(active(name, **{keys[name]: size}) for name, size in effects.items()), report_units=4096)
    evaluation = found.evaluation(found.references()["document B"], searching=False)
    play = evaluation.turn.play.astype(float)
    shift, growth = effects.get("process_mean_shift", 0.0), effects.get("spread_inflation", 0.0)
    changed = play.mean() + shift + (1.0 + growth) * (play - play.mean())
    overlap = np.maximum(-changed.min(axis=0), 0.0)
    assert evaluation.value("overlap_p95_arcmin") == pytest.approx(np.quantile(overlap, 0.95), abs=0.01)
    for name, count in (("interference_probability", changed.mean(axis=0) < 0.0),
                        ("interference_share_of_turn", np.mean(changed < 0.0, axis=0))):  # fmt: skip
        assert abs(evaluation.value(name) - count.mean()) < LIMIT * count.std() / np.sqrt(4096), name
    plain = outputs()["interference_probability"]
    assert np.sign(round(evaluation.value("interference_probability") - plain, 9)) in (
        (0.0,) if "lost_motion" in effects else (-np.sign(shift),) if shift else (-1.0, 1.0))  # fmt: skip


def test_an_output_without_a_rule_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MEASURES, "overlap_p95_arcmin", "tilt")
    problem()
    with pytest.raises(ModelError, match="overlap_p95_arcmin: no rule"):
        problem(active("process_mean_shift"))


def test_bounds_with_effects() -> None:
    plain, shifted = problem(), problem(active("process_mean_shift"))
    name = "backlash_max_arcmin"
    assert shifted.interval(name)[0] == pytest.approx(plain.interval(name)[0] - 0.15)
    assert problem(active("spread_inflation")).interval(name)[0] == -np.inf


def test_effects_without_a_counterpart_are_named() -> None:
    found = problem(active("gauge_bias", offset_arcmin=0.1), active("process_mean_shift"))
    assert [bool(one) for one in found.counterparts()] == [False, True]
    assert "gauge_bias has no counterpart" in found.effect_notes()[0]
    assert not found.without_effects().settings.effects
