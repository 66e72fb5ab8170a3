"""Effects in the transmission error problem, against units turned and assembled one by one."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import resample

from tolevo import registry
from tolevo.models.assembly.assemble import assemble
from tolevo.models.assembly.model import Assembly
from tolevo.models.effects.measurements import Active, predicted
from tolevo.problems.rv_transmission_error import RvTransmissionError, declared
from tolevo.problems.rv_transmission_error.problem import Residual
from tolevo.problems.settings import PropagationSetting, Settings, VariableSetting
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.units import ARCSEC, MRAD

Array = NDArray[np.float64]
DOCUMENT = np.array(list(declared.DOCUMENT_MRAD.values()))
COVERAGE = 0.95
UNITS = 800
TE = "te_amplitude_arcsec"


def active(name: str, **values: float) -> Active:
    return Active(registry.load("effects", name)(), values)


def problem(*effects: Active, coverage: float = COVERAGE) -> RvTransmissionError:
    setting = PropagationSetting(coverage=coverage, samples=8192)
    return RvTransmissionError(Settings(effects=effects, propagation=setting))


def design(precision: float = 0.0, scale: float = 1.0) -> Array:
    return np.array([[*(scale * DOCUMENT), precision]])


def te_of(found: ToleranceProblem, designs: Array) -> float:
    return float(found.outputs_of(designs, errors=False)[TE][0])


# ---------------------------------------------------------------- the assembly


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("adjustment_gain", {"adjustment_gain_error": -0.3}),
        ("chain_coupling", {"chain_coupling": 0.4}),
        ("springback", {"springback": 0.25}),
    ],
)
def test_assemblies_drawn_with_the_effect(name: str, values: dict[str, float]) -> None:
    """The same effect in the model `assembly`: 50,000 assemblies about z, within 5 errors."""
    one, count = active(name, **values), 50_000
    rng = np.random.default_rng(4)
    sigma = DOCUMENT.reshape(4, 3)[:, 2] / 3.0
    errors = sigma * rng.standard_normal((count, 4))
    table = {f"dtheta_{at}_mrad": errors[:, at - 1] for at in range(1, 5)}
    table["precision_weight"] = np.full(count, 5.0)
    drawn = predicted(Assembly(), "assembly", table, [one], rng)
    found = problem(one).outputs_of(design(5.0), errors=False)
    plain = problem().outputs_of(design(5.0), errors=False)
    for at in range(1, 5):
        expected = float(drawn[f"delta_{at}_mrad"].std())
        own = found[f"kc_{at}_z_std_mrad"][0]
        assert own == pytest.approx(expected, rel=5.0 / np.sqrt(2.0 * count)), at
    assert found[TE][0] != pytest.approx(plain[TE][0], rel=0.01)


def test_effects_and_parameters_of_the_assembly_add_up() -> None:
    given = RvTransmissionError(Settings(parameters={"springback": 0.3})).outputs_of(design(5.0), errors=False)
    half = Settings(parameters={"springback": 0.1}, effects=(active("springback", springback=0.2),))
    found = RvTransmissionError(half).outputs_of(design(5.0), errors=False)
    assert found[TE] == pytest.approx(given[TE], rel=1e-12)


# ---------------------------------------------------------------- waves, in every unit


@cache
def periods(precision: float) -> Array:
    """Transmission error (units, 120) [arcsec] of drawn units over the period: full model."""
    plain = problem()
    rng = np.random.default_rng(2)
    errors = DOCUMENT / 3.0 * MRAD * rng.standard_normal((UNITS, 12))
    state = assemble(plain.process, plain._gains(np.array([precision]))[0], errors).state
    error = declared.transmission({}).turn(state.reshape(-1, 4, 3)).error / ARCSEC
    return np.asarray(resample(error, 120, axis=1))


def turned(precision: float, waves: Array) -> Array:
    """Amplitude (units,) [arcsec] of drawn units by the full model, `waves` (4800,) over the turn.

    The error of a unit repeats 40 times per turn of the output; the waves do not.
    """
    return np.asarray(0.5 * np.ptp(np.tile(periods(precision), 40) + waves, axis=1))


THETA = 2.0 * np.pi * np.arange(4800) / 4800
WAVES: dict[str, tuple[list[Active], Array, float]] = {
    "order 40": (
        [active("eccentric_error", cos_40_arcsec=-15.0, sin_40_arcsec=12.0)],
        -15.0 * np.cos(40 * THETA) + 12.0 * np.sin(40 * THETA),
        0.04,
    ),
    "order 40 twice": (
        [
            active("eccentric_error", cos_40_arcsec=20.0),
            active("structural_resonance", cos_arcsec=-20.0, frequency_Hz=1e6, damping=0.1, order=40.0),
        ],
        np.zeros(4800),
        0.04,
    ),
    "order 1": (
        [active("output_eccentricity", cos_1_arcsec=6.0, sin_1_arcsec=8.0)],
        6.0 * np.cos(THETA) + 8.0 * np.sin(THETA),
        0.04,
    ),
    "order 39": ([active("pin_circle_runout", sin_39_arcsec=9.0)], 9.0 * np.sin(39 * THETA), 0.04),
    "order 78 by the torque": (
        [active("load_sharing", cos_78_arcsec_per_Nm=8.0 / 412.0)],
        8.0 * np.cos(78 * THETA),
        0.05,
    ),
}


@pytest.mark.parametrize("name", list(WAVES))
def test_quantile_against_waveforms_over_the_turn(name: str) -> None:
    """Sampled at 95 %: 3 % of the quantile; the waves are as large as the angles' own."""
    effects, waves, rel = WAVES[name]
    found = te_of(problem(*effects), design(5.0))
    assert found == pytest.approx(np.quantile(turned(5.0, waves), COVERAGE), rel=rel)


@pytest.mark.parametrize(
    ("effects", "waves", "most"),
    [
        ([active("two_disc_error", cos_80_arcsec=5.0)], 5.0 * np.cos(80 * THETA), 5.0),
        (
            [active("output_eccentricity", cos_1_arcsec=5.0), active("pin_circle_runout", sin_39_arcsec=6.0)],
            5.0 * np.cos(THETA) + 6.0 * np.sin(39 * THETA),
            11.0,
        ),
    ],
)
def test_orders_whose_crests_do_not_meet_are_bounded_from_above(
    effects: list[Active], waves: Array, most: float
) -> None:
    """Of any unit's waveform; by how much too high is stated in the documents."""
    bound, plain = te_of(problem(*effects), design(5.0)), te_of(problem(), design(5.0))
    assert bound == pytest.approx(plain + most, rel=2e-3)
    whole = turned(5.0, waves)
    assert np.all(whole <= turned(5.0, np.zeros(4800)) + most + 1e-9)
    assert np.quantile(whole, COVERAGE) < bound - 0.5


def test_pulse_adds_half_of_its_height() -> None:
    one = active("pitch_defect", height_arcsec=-7.0, position_deg=40.0, width=0.05)
    assert te_of(problem(one), design(5.0)) == pytest.approx(te_of(problem(), design(5.0)) + 3.5, rel=2e-3)


def test_round_scatter_about_a_wave_is_a_rice_distribution() -> None:
    """Rice (1944): length of a round Gaussian vector about a fixed one."""
    found = problem(active("eccentric_error", cos_40_arcsec=24.0, sin_40_arcsec=7.0))
    back, sigma = np.linalg.pinv(found.influence.order_40), 8.0
    radius = found._te(
        Residual(np.asarray(sigma * ARCSEC * back[None], dtype=np.float64), np.zeros(1)), searching=False
    )[0]
    expected = stats.rice.ppf(COVERAGE, 25.0 / sigma, scale=sigma)
    own = (radius - found.influence.base_amplitude) / ARCSEC
    assert own == pytest.approx(expected, rel=1e-3)


def test_resonance_is_read_at_the_speed_of_the_problem() -> None:
    """4 arcsec of order 39 at 15 rpm, 9.75 Hz: 1/(1 - r^2) at r = 0.975, little damped."""
    values = {"frequency_Hz": 10.0, "damping": 0.005, "order": 39.0, "sin_arcsec": 4.0}
    ratio, rest = 0.975, te_of(problem(), design(5.0))
    found = te_of(problem(active("structural_resonance", **values)), design(5.0)) - rest
    assert found == pytest.approx(4.0 / np.hypot(1.0 - ratio**2, 2 * 0.005 * ratio), rel=2e-3)


def test_stated_error_holds_with_waves() -> None:
    """Angles too small to matter: the full model has the wave too, and nothing else."""
    effects = [active("eccentric_error", cos_40_arcsec=30.0), active("pin_circle_runout", sin_39_arcsec=6.0)]
    found = problem(*effects).outputs_of(design(0.0, 0.02))
    assert found[TE][0] == pytest.approx(36.0, rel=0.05)
    assert abs(found["te_error_percent"][0]) < 1.0


def test_bounds_hold_with_waves() -> None:
    effects = (active("eccentric_error", cos_40_arcsec=9.0), active("springback", springback=0.2),
               active("pin_circle_runout", cos_39_arcsec=3.0))  # fmt: skip
    found = problem(*effects)
    x = np.random.default_rng(0).uniform(found.xl, found.xu, (60, found.n_var))
    te = found.outputs_of(found.complete(x), searching=True)[TE]
    low, _ = found.interval(TE)
    assert low == pytest.approx(3.0, abs=0.1)
    assert np.all(te >= low)


# ---------------------------------------------------------------- what is told


def test_effects_without_a_counterpart_are_named() -> None:
    effects = (
        active("adjustment_backlash", adjustment_backlash_mrad=0.2),
        active("torsional_compliance", compliance_arcsec_per_Nm=0.1),
        active("encoder_harmonics", cos_1_arcsec=5.0),
        active("output_eccentricity", cos_1_arcmin=5.0),  # of another model's reading
        active("springback", springback=0.1),
        active("eccentric_error", cos_40_arcsec=3.0, sin_40_arcsec=4.0),
    )
    found = problem(*effects)
    told = found.counterparts()
    assert [bool(one) for one in told] == [False] * 4 + [True] * 2
    assert "has no counterpart in this problem" in found.effect_notes()[0]
    assert told[4] == "0.1 of the total adjustment returns at the end"
    assert "5 arcsec of order 40" in told[5]
    silent = problem(*effects[:4])
    own, plain = (one.outputs_of(design(5.0), searching=True) for one in (silent, problem()))
    for name, values in plain.items():
        np.testing.assert_array_equal(own[name], values)


def test_form_stays_below_with_waves() -> None:
    """Anderson (1955): a fixed wave only widens; other orders move it up with the problem."""
    effects = (active("eccentric_error", cos_40_arcsec=9.0, sin_40_arcsec=5.0),
               active("pin_circle_runout", cos_39_arcsec=3.0))  # fmt: skip
    fixed = {"precision_weight": VariableSetting(value=5.0)}
    found = RvTransmissionError(Settings(variables=fixed, effects=effects))
    form = found.form()
    assert form is not None
    x = np.random.default_rng(1).uniform(found.xl, found.xu, (60, found.n_var))
    designs = found.complete(x)
    spread = np.array([feature.ways[0].spread[0] for feature in form.features])
    bound = form.offset[0] + np.sqrt(form.constant[0] + designs[:, :12] ** 2 @ spread**2)
    te = found.outputs_of(designs, searching=True)[TE]
    assert np.all(bound <= te)
    assert np.max(te / bound) < 2.0
