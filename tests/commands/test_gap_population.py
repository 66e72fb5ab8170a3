"""Batches: what is named of units whose distribution this file changes, and how far they are."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.library import OfMeanUnit, law_of
from tolevo.commands.gap.page import path_figure
from tolevo.commands.gap.plan import GapPlan
from tolevo.commands.gap.population import distance, floor
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult
from tolevo.configuration.reader import read_table
from tolevo.errors import InputError
from tolevo.models.effects.measurements import predicted
from tolevo.models.effects.population import Law
from tolevo.models.propagation import Convolution
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.units import ARCMIN

DOCUMENT = {"model": "document", "reading": "printed"}
"""Units by document B's closed form, as printed."""
PLAN = 'model = "rv_batch"\nparameters = { model = "document", reading = "printed" }\n'

Array = np.ndarray
Table = dict[str, Array]
N = 400
BACKLASH = "backlash_arcmin"


def normal() -> Law:
    """The standard normal, on a lattice."""
    lattice = np.linspace(-5.0, 5.0, 501)
    return Law(-5.0, 0.02, stats.norm.logpdf(lattice), 1.0)


def test_law_widened_and_mixed() -> None:
    x = np.linspace(-4.0, 7.0, 23)
    np.testing.assert_allclose(
        normal().widened(0.5)(x), stats.norm.logpdf(x, scale=1.5), atol=1e-4
    )  # fmt: skip
    mixed = normal().mixed(3.0, 0.2)
    expected = 0.8 * stats.norm.pdf(x) + 0.2 * stats.norm.pdf(x, 3.0)
    np.testing.assert_allclose(np.exp(mixed(x)), expected, rtol=2e-3)
    assert mixed.histogram.mean() == pytest.approx(0.6, abs=1e-3)
    assert mixed.histogram.std() == pytest.approx(np.sqrt(1.0 + 0.16 * 9.0), rel=1e-3)
    assert mixed.std == pytest.approx(np.sqrt(1.0 + 0.16 * 9.0))


def test_law_falls_beyond_its_lattice() -> None:
    assert np.all(np.diff(normal()(np.linspace(4.9, 30.0, 200))) < 0.0)
    assert np.isfinite(normal()(np.array([-1e3, 1e3]))).all()


def test_law_is_that_of_the_units() -> None:
    """Its scatter is the exact one of the convolution."""
    model = RvBatch(DOCUMENT)
    exact = Convolution().propagate(model.total, 0.9973, ARCMIN)
    law = law_of(GapPlan("rv_batch", model), BACKLASH)
    error = 4.0 * np.sqrt(0.5 / 200_000)  # of the drawn units; the kernel adds 0.5 %
    assert law.std == pytest.approx(float(exact.std.value[0]) / ARCMIN, rel=error)
    assert law.histogram.std() == pytest.approx(law.std, rel=error + 0.006)
    assert law.histogram.mean() == pytest.approx(0.0, abs=4.0 * law.std / np.sqrt(200_000))


def test_distance_of_normal_populations() -> None:
    """sqrt((m1 - m2)^2 + (s1 - s2)^2): Givens and Shortt, Michigan Math. J. 31, 1984."""
    units = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)
    assert distance(normal(), units) < 1e-3
    assert distance(normal(), 0.3 + units) == pytest.approx(0.3, rel=1e-3)
    assert distance(normal(), 0.3 + 1.4 * units) == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize("count", [30, 300])
def test_floor_holds_for_the_share_it_says(count: int) -> None:
    rng = np.random.default_rng(count)
    limit = floor(normal(), count, rng)
    near = sum(distance(normal(), rng.normal(size=count)) <= limit for _ in range(400))
    low, high = (float(stats.binom.ppf(p, 400, 0.95)) for p in (0.0005, 0.9995))
    assert low - 6 <= near <= high + 6  # the floor itself is a quantile of 400


def units(n: int = N, seed: int = 1) -> Table:
    table: Table = {"unit": np.arange(1, n + 1).astype(str)}
    drawn = RvBatch(DOCUMENT).predict(table, np.random.default_rng(seed))
    return table | drawn


def lots(table: Table, seed: int = 5) -> Table:
    """In three lots."""
    names = np.random.default_rng(seed).choice(np.array(["A", "B", "C"]), len(table["unit"]))
    return {**table, "lot": names}


def changed(table: Table, by: Callable[[Array, np.random.Generator], Array]) -> Table:
    y = table[BACKLASH]
    return {**table, BACKLASH: by(y, np.random.default_rng(7))}


def mixed(offset: float, share: float) -> Callable[[Array, np.random.Generator], Array]:
    """Standard deviations by which a share of the units is off."""
    return lambda y, rng: y + offset * y.std() * (rng.random(len(y)) < share)


BATCHES: Mapping[str, Callable[[], Table]] = {
    "mixed up": lambda: changed(units(seed=2), mixed(2.6, 0.35)),
    "mixed down": lambda: changed(lots(units(seed=3)), mixed(-3.2, 0.15)),
    "shifted": lambda: changed(units(seed=4), lambda y, _: y + 0.5 * y.std()),
    "widened": lambda: changed(units(seed=5), lambda y, _: y.mean() + 1.5 * (y - y.mean())),
    "drifting": lambda: changed(
        units(seed=6), lambda y, _: y + 1.5 * y.std() * np.arange(N) / N
    ),
    "shifted and widened": lambda: changed(
        units(seed=8), lambda y, _: y.mean() + 0.3 + 1.6 * (y - y.mean())
    ),
    "narrowed": lambda: changed(units(seed=9), lambda y, _: 0.7 + 0.5 * (y - y.mean())),
}  # fmt: skip


def analysed(table: Mapping[str, Array], text: str = "[free]\n") -> GapResult:
    with TemporaryDirectory() as folder:
        configuration, data = Path(folder, "gap.toml"), Path(folder, "units.csv")
        configuration.write_text(f"{PLAN}{text}", encoding="utf-8")
        pd.DataFrame(table).to_csv(data, index=False)
        plan = read_gap(configuration)
        return gap.analysis_result(plan, read_data(plan, data))


@lru_cache
def found(name: str) -> GapResult:
    return analysed(BATCHES[name]())


def simulated(result: GapResult, table: Table, batches: int = 100) -> Array:
    """Units of the corrected configuration, batch after batch of those of the table."""
    keys = ("model", "seed", "parameters", "variables", "effect")
    written = tomllib.loads(result.corrected)
    effects = read_table({k: v for k, v in written.items() if k in keys}, []).settings.effects
    return np.concatenate([
        predicted(RvBatch(DOCUMENT), "rv_batch", table, effects, np.random.default_rng(k))[BACKLASH]
        for k in range(batches)
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("name", "effects"),
    [
        pytest.param("mixed up", ("lot_mixture",), marks=pytest.mark.slow),
        ("mixed down", ("lot_mixture",)),
        pytest.param("shifted", ("process_mean_shift",), marks=pytest.mark.slow),
        pytest.param("widened", ("spread_inflation",), marks=pytest.mark.slow),
        ("drifting", ("tool_wear_drift",)),
        ("shifted and widened", ("process_mean_shift", "spread_inflation")),
    ],
)
def test_a_batch_comes_back(name: str, effects: tuple[str, ...]) -> None:
    """Named by what was done to it; its distance from the population falls to what chance reaches,
    and units of the corrected model have its mean and its standard deviation.
    """
    result, table = found(name), BATCHES[name]()
    assert result.names == effects
    before, after, chance = (part[BACKLASH] for part in (result.gap_before, result.gap_after, result.noise_floor))
    assert before > 2.0 * chance
    assert after < 1.1 * chance
    y = table[BACKLASH]
    drawn = simulated(result, {k: v for k, v in table.items() if k != BACKLASH})
    d = y - y.mean()
    of_std = np.sqrt((np.mean(d**4) - np.mean(d**2) ** 2) / N) / (2.0 * y.std())
    assert y.mean() == pytest.approx(drawn.mean(), abs=3.0 * y.std() / np.sqrt(N))
    assert y.std() == pytest.approx(drawn.std(), abs=3.0 * of_std)


@pytest.mark.parametrize("name", ["mixed down", "shifted and widened"])
def test_the_figure_is_of_the_model_before_and_of_the_corrected_configuration_after(name: str) -> None:
    """Both were drawn with the effect on the scatter once more: before with it, after with it twice."""
    result, table = found(name), BATCHES[name]()
    inputs = {k: v for k, v in table.items() if k != BACKLASH}
    plain = RvBatch(DOCUMENT).predict({"unit": np.arange(40000).astype(str)}, np.random.default_rng(3))[BACKLASH]
    shares = result.units["share"].to_numpy()
    for side, units_of_model in (("before", plain), ("after", simulated(result, inputs))):
        expected = np.quantile(units_of_model, shares)
        off = (result.units[side].to_numpy() - expected) / plain.std()
        assert np.sqrt(np.mean(off**2)) < 0.04  # of 20,000 units; the effect once more moved it by 0.6 and 0.77
    np.testing.assert_allclose(result.units["measured"], np.quantile(table[BACKLASH], shares))


def test_steps_tell_what_the_mixture_did() -> None:
    """The shift that was named first is dropped beside it."""
    done = [(one.action, one.name) for one in found("mixed up").steps if one.accepted]
    assert done == [("start", ""), ("add", done[1][1]), ("add", "lot_mixture"), ("drop", done[1][1])]
    (effect,) = found("mixed up").effects
    assert effect.held_out_gain > effect.held_out_error > 0.0
    numbers = {one.name: one for one in effect.parameters}
    assert numbers["share"].low < 0.35 < numbers["share"].high
    step = 2.6 * units(seed=2)[BACKLASH].std()
    assert numbers["offset_arcmin"].low < step < numbers["offset_arcmin"].high


def test_steps_of_a_batch_are_drawn_by_what_they_gain() -> None:
    """A batch has no rows to leave out: its figure shows the gain over what a step must gain."""
    result = found("mixed up")
    figure = path_figure(result)
    assert figure is not None
    (axes,) = figure.axes
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "gain over the least gain of a step"
    shown = [one for one in result.steps if one.gain > 0.0 and one.threshold > 0.0]
    lines = {str(line.get_label()): line for line in axes.get_lines()}
    expected = [one.gain / one.threshold for one in shown if one.accepted]
    drawn = np.asarray(lines["accepted"].get_xdata(), dtype=float)
    np.testing.assert_allclose(drawn, expected)
    assert "least gain of a step" in lines
    added = [one for one in shown if one.action == "add"]
    assert len(added) >= 2
    assert all(one.accepted <= (one.gain > one.threshold) for one in added)


def test_a_drift_that_hides_a_mixture_goes() -> None:
    """More units of the second supplier at the end, by chance: the drift is named first."""
    table = units(120, seed=20)
    second = np.random.default_rng(217)
    table[BACKLASH] = mixed(3.5, 0.3)(table[BACKLASH], second)
    result = analysed(table)
    assert ("add", "tool_wear_drift") in [(one.action, one.name) for one in result.steps]
    assert result.names == ("lot_mixture",)


def test_the_shift_goes_before_its_twins() -> None:
    """The gauge is its twin, and without a thermometer so is a warmer disc."""
    result = found("shifted")
    assert result.verdict == "ambiguous"
    assert {one.names for one in result.rivals} == {
        ("gauge_bias",), ("differential_thermal_expansion",)
    }  # fmt: skip


def test_less_scatter_has_a_gap_but_no_name() -> None:
    result = found("narrowed")
    assert result.verdict == "unnamed"
    assert result.names == ()
    assert "scatter unlike the population" in result.shapes[0].text
    assert "0.50 times as large" in result.shapes[0].text


def test_any_lot_may_be_the_one_that_is_off() -> None:
    table = lots(units(250, seed=11))
    table[BACKLASH] = table[BACKLASH] + 0.3 * (table["lot"] == "A")
    result = analysed(table)
    assert result.names == ("lot_offset",)
    numbers = {one.name: one for one in result.effects[0].parameters}
    assert numbers["offset_A_arcmin"].low < 0.3 < numbers["offset_A_arcmin"].high


def test_a_few_far_out_are_no_second_supplier() -> None:
    table = units(300, seed=12)
    table[BACKLASH][[20, 150, 260]] += [3.0, -2.5, 4.0]
    result = analysed(table)
    assert result.names == ()
    assert any("3 outliers" in note for note in result.notes)


def refused(table: Mapping[str, Array]) -> str:
    with pytest.raises(InputError) as caught:
        analysed(table)
    return str(caught.value)


def test_too_few_units() -> None:
    assert "cannot tell with n = 3" in refused(units(3))
    two = {**units(2), "lot": np.array(["A", "B"])}
    assert "cannot tell with n = 2" in refused(two)


@pytest.mark.parametrize("repeat", [False, True])
def test_one_unit_measured_many_times(repeat: bool) -> None:
    y = 0.9 + 0.01 * np.random.default_rng(0).normal(size=40)
    table: Table = {"unit": np.ones(40), BACKLASH: y}
    said = refused(table | ({"repeat": np.arange(40)} if repeat else {}))
    assert "holds 1 units in 40 rows: cannot tell with n = 1" in said


def test_identical_values() -> None:
    table = {**units(40), BACKLASH: np.full(40, 0.9)}
    assert "is the same in every row" in refused(table)
    nearly = 0.9 + 1e-6 * np.random.default_rng(1).normal(size=40)
    result = analysed({**table, BACKLASH: nearly})
    assert result.names == ()
    assert any("cannot tell" in note and "one unit" in note for note in result.notes)


def test_twelve_units_have_no_cause() -> None:
    result = analysed(changed(units(12), lambda y, _: y + 5.0))
    assert (result.verdict, result.names) == ("unnamed", ())
    assert any("cannot tell with n = 12" in note for note in result.notes)


def test_lots_of_one_unit_have_no_offset() -> None:
    table = {**units(40), "lot": np.array(["A"] * 38 + ["B", "C"])}
    table[BACKLASH][38:] += 2.0
    result = analysed(table)
    assert "lot_offset" not in result.names
    assert any("the offset of lots of fewer" in note and "B, C" in note for note in result.notes)


def test_repeats_are_one_unit() -> None:
    """Measurements of a unit are no units: their mean is, once."""
    table = units(25, seed=13)
    rng = np.random.default_rng(2)
    twice = {name: np.repeat(values, 4) for name, values in table.items()}
    twice[BACKLASH] = twice[BACKLASH] + 0.01 * rng.normal(size=100)
    result = analysed({**twice, "repeat": np.tile(np.arange(4), 25)})
    assert len(result.residuals) == 25
    assert result.names == ()
    means = twice[BACKLASH].reshape(25, 4).mean(axis=1)
    np.testing.assert_allclose(result.residuals[BACKLASH], means)
    assert any("100 measurements of 25 units" in note for note in result.notes)


def test_mean_unit_is_that_of_drawn_units() -> None:
    """Each row with its own warm disc: against 20,000 units drawn at each of three of them."""
    rows = np.array([0.0, 3.0, 11.0])
    model = RvBatch(DOCUMENT)
    with TemporaryDirectory() as folder:
        path = Path(folder, "units.csv")
        pd.DataFrame(units(30)).to_csv(path, index=False)
        plan = GapPlan("rv_batch", model)
        data = read_data(plan, path)
    warmer = np.resize(rows, 30)
    means = OfMeanUnit(plan, data, model)({"disc_temperature_K": warmer})[BACKLASH]
    for at, kelvin in enumerate(rows):
        table = {"unit": np.arange(20_000)}
        change = {"disc_temperature_K": np.full(20_000, kelvin)}
        seen = model.predict(table, np.random.default_rng(at), change)[BACKLASH]
        assert means[at] == pytest.approx(seen.mean(), abs=4.0 * seen.std() / np.sqrt(20_000))


def test_a_mixture_that_is_in_the_model_is_no_gap() -> None:
    result, table = found("mixed down"), BATCHES["mixed down"]()
    with TemporaryDirectory() as folder:
        configuration, data = Path(folder, "corrected.toml"), Path(folder, "units.csv")
        configuration.write_text(result.corrected, encoding="utf-8")
        pd.DataFrame(table).to_csv(data, index=False)
        plan = read_gap(configuration)
        again = gap.analysis_result(plan, read_data(plan, data))
    assert again.verdict == "no_gap", [str(one) for one in again.effects]
    assert again.gap_before[BACKLASH] < 1.1 * result.noise_floor[BACKLASH]


STRUCTURES: Mapping[str, Callable[[Array, Array], Array]] = {
    "two waves along the units": lambda y, at: y + 0.9 * y.std() * np.sin(4.0 * np.pi * at),
    "a step at three fifths": lambda y, at: y + 1.3 * y.std() * (at > 0.6),
    "a skew": lambda y, at: y + 0.6 * (y - y.mean()) ** 2 / y.std(),
    "clipped": lambda y, at: np.minimum(y, y.mean() + 0.4 * y.std()),
}
"""What no effect of the library does, at places `at` (n,) in 0..1 of the production."""


@pytest.mark.parametrize("name", STRUCTURES)
def test_what_is_no_effect_of_the_library_has_no_name(name: str) -> None:
    """Units that follow something are not wider, those of another shape not only shifted."""
    table = units(seed=11)
    table[BACKLASH] = STRUCTURES[name](table[BACKLASH], np.linspace(0.0, 1.0, N))
    result = analysed(table)
    assert result.verdict == "unnamed"
    assert result.shapes


def test_a_drift_about_the_mean_is_a_drift_and_a_shift() -> None:
    """Neither shows alone: the drift begins at 0, and the mean is where it was."""
    table = units(seed=12)
    table[BACKLASH] = table[BACKLASH] + 1.6 * table[BACKLASH].std() * np.linspace(-1.0, 1.0, N)
    assert set(analysed(table).names) == {"tool_wear_drift", "process_mean_shift"}


def test_where_tells_the_units() -> None:
    table = units(seed=13)
    table[BACKLASH] = table[BACKLASH] + 1.5 * table[BACKLASH].std() * (np.arange(N) >= 300)
    region = analysed(table).where[0]
    assert (region.variable, region.kind) == ("unit", "trend")
    assert region.high > 300.0


@pytest.mark.parametrize("consider", [["gravity_sag"], ["spread_inflation", "lot_mixture"]])
def test_a_library_that_moves_no_unit(consider: list[str]) -> None:
    result = analysed(BATCHES["widened"](), f"[free]\n[effects]\nconsider = {consider}\n")
    assert set(result.names) <= set(consider)
