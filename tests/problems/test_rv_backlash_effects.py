"""Effects in the backlash problem, against units drawn one by one and against closed forms."""

import math

import numpy as np
import pytest

from tolevo import registry
from tolevo.models.effects.measurements import Active, predicted
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_backlash.form import form_of
from tolevo.problems.settings import PropagationSetting, Settings
from tolevo.section import Array

DOCUMENT = {"model": "document"}
"""Units by document B's closed form."""

UNITS = 200_000
LIMIT = 5.0
"""Standard errors allowed."""
EFFECTS: dict[str, dict[str, float]] = {
    "differential_thermal_expansion": {"temperature_difference_K": -4.0},
    "spread_inflation": {"growth": 0.6},
    "process_mean_shift": {"shift_arcmin": -0.15},
}


def active(name: str, **values: float) -> Active:
    return Active(registry.load("effects", name)(), values or EFFECTS[name])


def problem(*effects: Active, method: str = "convolution", **more: object) -> RvBacklash:
    return RvBacklash(Settings(effects=effects, propagation=PropagationSetting(method)))


def documents(found: RvBacklash) -> Array:
    return found.references()["document B"][None, :]


def outputs(*effects: Active, method: str = "convolution") -> dict[str, float]:
    found = problem(*effects, method=method)
    return {name: float(v[0]) for name, v in found.outputs_of(documents(found)).items()}


@pytest.mark.parametrize("names", [[name] for name in EFFECTS] + [list(EFFECTS)])
@pytest.mark.parametrize("method", ["convolution", "moments"])
def test_units_drawn_with_the_effects(names: list[str], method: str) -> None:
    """The same effects in the model of a batch: drawn, not propagated."""
    effects = [active(name) for name in names]
    table = {"unit": np.arange(UNITS)}
    rng = np.random.default_rng(8)
    drawn = predicted(RvBatch(DOCUMENT), "rv_batch", table, effects, rng)["backlash_arcmin"]
    found = outputs(*effects, method=method)
    mean, std = found["backlash_mean_arcmin"], found["backlash_std_arcmin"]
    slack = 0.0 if method == "convolution" else 0.02 * std  # moments are an expansion
    assert abs(drawn.mean() - mean) <= LIMIT * std / math.sqrt(UNITS) + slack
    assert drawn.std() == pytest.approx(std, abs=LIMIT * std / math.sqrt(UNITS) + slack)
    share = np.mean(drawn <= 1.0)
    error = math.sqrt(share * (1.0 - share) / UNITS)
    within = found["yield_percent"] / 100.0
    assert abs(share - within) < LIMIT * error + (slack and 0.01)
    below = np.mean(drawn <= found["backlash_arcmin"])
    assert abs(below - 0.9973) < LIMIT * math.sqrt(0.0027 / UNITS) + (slack and 0.003)


def test_gap_adds_both_of_its_halves() -> None:
    plain = outputs()
    for name in ("lost_motion", "bearing_clearance"):
        found = outputs(active(name, half_width_arcmin=0.2))
        for key in ("backlash_arcmin", "backlash_mean_arcmin", "backlash_geometric_mean_arcmin"):
            assert found[key] == pytest.approx(plain[key] + 0.4, rel=1e-9), key
        assert found["backlash_std_arcmin"] == pytest.approx(plain["backlash_std_arcmin"])
        assert found["phi_1_arcmin"] == plain["phi_1_arcmin"]


def test_warm_disc_is_a_change_of_phi_2() -> None:
    """-0.0582 arcmin/K of the disc, 117/121 of it at the carrier; interference grows."""
    plain, warm = outputs(), outputs(active("differential_thermal_expansion",
                                            temperature_difference_K=2.0))  # fmt: skip
    assert warm["phi_2_arcmin"] - plain["phi_2_arcmin"] == pytest.approx(-0.1164 * 117 / 121, abs=1e-4)
    assert warm["interference_probability"] > plain["interference_probability"]
    assert warm["cost"] == plain["cost"]


def test_bounds_of_the_backlash_hold_with_effects() -> None:
    effects = [active("process_mean_shift"), active("differential_thermal_expansion")]
    for chosen in (effects, [*effects, active("spread_inflation")]):
        found = problem(*chosen)
        rng = np.random.default_rng(0)
        x = rng.uniform(found.xl, found.xu, size=(100, found.n_var))
        values = found.outputs_of(found.complete(x))
        for name in ("backlash_arcmin", "backlash_mean_arcmin", "yield_percent"):
            low, high = found.interval(name)
            assert np.all(values[name] >= low - 1e-9), name
            assert np.all(values[name] <= high + 1e-9), name


def test_form_holds_the_shift() -> None:
    """Offsets move as the backlash of every design does: geometric with its mean, and effective."""
    plain, shifted = problem(), problem(active("process_mean_shift"))
    for make, moved in ((form_of, [-0.15, -0.15, 0.0]), (RvBacklash.form, [-0.15])):
        forms = make(plain), make(shifted)
        assert forms[0] is not None
        assert forms[1] is not None
        np.testing.assert_allclose(np.asarray(forms[1].offset) - forms[0].offset, moved, atol=1e-12)
    assert problem(active("spread_inflation")).form() is None


def test_gradient_with_effects_is_that_of_finite_differences() -> None:
    found = problem(active("spread_inflation"), active("process_mean_shift"))
    design = found.complete(np.atleast_2d(0.5 * (found.xl + found.xu)))
    slopes = found.gradient(design)["backlash_geometric_arcmin"][0]
    for name in ("pin_circle_radius_um", "crank_bearing_um"):
        at, h = found.names.index(name), 1e-3
        ends = []
        for way in (-h, h):
            moved = design.copy()
            moved[0, at] += way
            ends.append(found.outputs_of(moved)["backlash_geometric_arcmin"][0])
        assert slopes[at] == pytest.approx((ends[1] - ends[0]) / (2.0 * h), rel=1e-5)


def test_effects_without_a_counterpart_are_named() -> None:
    effects = (
        active("gauge_bias", offset_arcmin=0.1),
        active("differential_thermal_expansion", temperature_share=0.3),
        active("process_mean_shift"),
    )
    found = problem(*effects)
    notes = found.effect_notes()
    assert [bool(one) for one in found.counterparts()] == [False, False, True]
    assert notes[0] == "effect gauge_bias has no counterpart in this problem: it changes nothing here"
    assert "changes by -0.15 arcmin" in notes[2]
    assert not found.without_effects().settings.effects
    assert found.reported().settings.effects == effects
    assert PoseAccuracy(Settings(effects=(active("drift", rate_mm_per_s=1.0),))).counterparts() == ("",)
