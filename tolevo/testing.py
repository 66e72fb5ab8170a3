"""Contract tests that plugins inherit, ours first.

class TestMyProblem(ProblemContract):
    problem_type = MyProblem
"""

from __future__ import annotations

import pickle
import re
from dataclasses import fields, replace
from functools import cache
from html.parser import HTMLParser
from math import isfinite
from pathlib import Path
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.integrate import quad

from .algorithms.checkpoint import Checkpoint
from .algorithms.run import Progress
from .algorithms.search import search
from .algorithms.settings import AlgorithmSettings, Budget
from .commands.run.choice import COST, RULE_KINDS, ChoiceRule, Points
from .commands.study.designs import DESIGNS
from .commands.study.plan import Design, Factor, Level
from .configuration.search import settings_of
from .errors import Fault
from .models.capability import Knowledge
from .models.cost_reading import curve_table, read_curve
from .models.costs import CURVES, CostCurve
from .models.effects.effect import FAMILIES, Action, Effect, EffectParameter, Measurements, Target
from .models.effects.measurements import measurements_of, target_from
from .models.gear import RV_40E
from .models.input_reading import read_distribution, written
from .models.inputs import DISTRIBUTIONS, Distribution
from .models.measurable import Column, MeasurableModel, Role
from .problems.deviations import Deviations, PromisedOutput
from .problems.promise import Promising
from .problems.settings import ASSURED, PROMISED, Promise
from .problems.tolerance_problem import ToleranceProblem
from .records import SECTIONS, PageSection, RunResult
from .section import Output, Section
from .units import dimension

__all__ = [
    "COLUMNS",
    "AlgorithmContract",
    "CurveContract",
    "DesignContract",
    "DistributionContract",
    "EffectContract",
    "ModelContract",
    "PageContract",
    "ProblemContract",
    "PromisingContract",
    "RuleContract",
]

# The contract of an algorithm.


class AlgorithmContract:
    """What every algorithm plugin must keep, on a problem with as many objectives as it takes."""

    settings: ClassVar[AlgorithmSettings]

    def problem(self) -> ToleranceProblem:
        """The problem that the algorithm is tested on."""
        raise TypeError("give the problem to try the algorithm on")

    def test_evaluation_budget_is_exact(self) -> None:
        result = search(self.problem(), self.settings, Budget(evaluations=73), seed=0)
        assert result.evaluations == 73

    def test_same_seed_same_result(self) -> None:
        budget = Budget(evaluations=90)
        runs = [search(self.problem(), self.settings, budget, seed=0) for _ in range(2)]
        np.testing.assert_array_equal(runs[0].x, runs[1].x)
        np.testing.assert_array_equal(runs[0].f, runs[1].f)

    def test_other_seed_other_result(self) -> None:
        budget = Budget(evaluations=40)
        runs = [search(self.problem(), self.settings, budget, seed=s) for s in (0, 1)]
        same = np.array_equal(runs[0].x, runs[1].x)
        assert not (same and np.array_equal(runs[0].miss, runs[1].miss))

    def test_stays_within_bounds(self) -> None:
        problem = self.problem()
        result = search(problem, self.settings, Budget(evaluations=80), seed=3)
        assert np.all(result.x >= problem.xl) and np.all(result.x <= problem.xu)

    def test_stopped_and_resumed_is_as_unbroken(self, tmp_path: Path) -> None:
        def stop(state: Progress) -> None:
            if state.evaluations > 55:
                raise KeyboardInterrupt

        budget, path = Budget(evaluations=110), tmp_path / "checkpoint.npz"
        for engine in ("pymoo", "array") if self.settings.array_engine else ("pymoo",):
            whole = search(self.problem(), self.settings, budget, 0, engine=engine)
            first = Checkpoint(path, "", every=0.0)
            first.write()
            search(self.problem(), self.settings, budget, 0, stop, engine, first)
            resumed = search(self.problem(), self.settings, budget, 0, None, engine, Checkpoint.read(path))
            assert resumed.evaluations == whole.evaluations
            np.testing.assert_array_equal(resumed.x, whole.x)
            np.testing.assert_array_equal(resumed.f, whole.f)
            np.testing.assert_array_equal(resumed.miss, whole.miss)
            values = [[p.hypervolume for p in result.history] for result in (resumed, whole)]
            assert values[0] == values[1]


# The contract of a cost curve.


class CurveContract:
    """What every `CostCurve` must keep between two tolerances, in the unit of its variable."""

    curve: ClassVar[CostCurve]
    low: ClassVar[float] = 0.01
    high: ClassVar[float] = 1.0

    def _tolerances(self) -> np.ndarray:
        """Tolerances (n,) away from where the slope jumps."""
        whole = np.geomspace(self.low, self.high, 203)[1:-1]
        near = [np.abs(whole - bend) < 1e-3 * bend for bend in self.curve.bends]
        return whole[~np.any(near, axis=0)] if near else whole

    def test_is_registered_and_comes_back_from_its_table(self) -> None:
        assert CURVES.name_of(type(self.curve)) in CURVES
        faults: list[Fault] = []
        assert read_curve(Section(curve_table(self.curve), "costs", faults)) == self.curve
        assert not faults

    def test_coefficients_are_accepted(self) -> None:
        assert self.curve.faults() == []

    def test_cost_is_finite_and_falls(self) -> None:
        cost = self.curve.cost(self._tolerances())
        assert np.all(np.isfinite(cost))
        assert np.all(np.diff(cost) <= 1e-12 * np.abs(cost[:-1]))

    def test_slope_is_that_of_the_cost(self) -> None:
        t = self._tolerances() if self.curve.smooth else np.empty(0)
        h = 1e-6 * t
        slope = (self.curve.cost(t + h) - self.curve.cost(t - h)) / (2.0 * h)
        scale = np.max(np.abs(slope), initial=1e-12)
        np.testing.assert_allclose(self.curve.slope(t), slope, rtol=1e-5, atol=1e-7 * scale)

    def test_best_is_no_dearer_than_a_grid(self) -> None:
        t = np.geomspace(self.low, self.high, 2001)
        for linear, square in ((1.0, 0.0), (0.0, 1.0), (3.0, 2.0), (50.0, 400.0)):
            prices = np.array([linear]), np.array([square])
            best = self.curve.best(*prices, self.low, self.high)
            assert self.low <= best[0] <= self.high
            if not self.curve.priced:
                grid = self.curve.cost(t) + linear * t + square * t**2
                least = self.curve.cost(best) + linear * best + square * best**2
                assert least[0] <= np.min(grid) * (1.0 + 1e-9) + 1e-9


# The contract of a design of experiments.


ANALYSES = frozenset(("factorial", "latin_hypercube", "morris", "one_at_a_time", "sobol", "table"))


class DesignContract:
    """What every `Design` of settings must keep, for two ranged keys and one with levels."""

    design: ClassVar[Design]
    seeds: ClassVar[int] = 8
    factors: ClassVar[tuple[Factor, ...]] = (
        Factor("algorithm.population", low=20.0, high=80.0, integer=True),
        Factor("algorithm.mutation.probability", low=0.01, high=0.5, log=True),
        Factor("algorithm.crossover.eta", levels=(5.0, 15.0, 30.0)),
    )

    def _points(self, seed: int = 0) -> pd.DataFrame:
        base: dict[str, Level] = {
            factor.key: factor.low if factor.ranged else factor.levels[0] for factor in self.factors
        }
        return self.design.points(self.factors, base, np.random.default_rng(seed))

    def test_is_registered_and_comes_back_from_its_table(self) -> None:
        kind = type(self.design)
        assert DESIGNS[kind.kind] is kind
        assert kind.analysis in ANALYSES
        table = {field.name: getattr(self.design, field.name) for field in fields(kind)}  # type: ignore[arg-type]
        faults: list[Fault] = []
        assert settings_of(Section(table, "design", faults), kind) == self.design
        assert not faults

    def test_these_factors_are_accepted(self) -> None:
        assert self.design.faults(self.factors, self.seeds) == []

    def test_settings_lie_within_the_factors(self) -> None:
        points = self._points()
        assert len(points) == self.design.size(self.factors)
        for factor in self.factors:
            values = points[factor.key]
            if factor.ranged:
                assert values.between(factor.low, factor.high).all()
                assert not factor.integer or (values == values.round()).all()
            else:
                assert set(values) <= set(factor.levels)

    def test_columns_beside_the_keys_begin_with_an_underscore(self) -> None:
        more = set(map(str, self._points())) - {factor.key for factor in self.factors}
        assert all(name.startswith("_") for name in more)

    def test_same_generator_same_settings(self) -> None:
        pd.testing.assert_frame_equal(self._points(3), self._points(3))


# The contract of a distribution.


class DistributionContract:
    """What every `Distribution` of a standardised deviation must keep."""

    distribution: ClassVar[Distribution]

    def test_is_registered_and_comes_back_from_its_table(self) -> None:
        distribution, faults = self.distribution, list[object]()
        assert DISTRIBUTIONS.name_of(type(distribution)) in DISTRIBUTIONS
        assert read_distribution(Section(written(distribution), "part", faults)) == distribution  # type: ignore[arg-type]
        assert not faults

    def test_parameters_are_accepted(self) -> None:
        assert self.distribution.faults() == []

    def test_quantiles_rise_within_the_support(self) -> None:
        low, high = self.distribution.support
        z = self.distribution.quantile(np.linspace(1e-6, 1.0 - 1e-6, 501))
        assert np.all(np.diff(z) >= 0.0) and low - 1e-9 <= z[0] and z[-1] <= high + 1e-9
        assert not self.distribution.one_sided or z[0] >= 0.0

    def test_partial_moments_are_those_of_the_quantiles(self) -> None:
        p = np.array([0.05, 0.3, 0.5, 0.8, 0.999])
        z = self.distribution.quantile(p)
        moments = self.distribution.partial_moments(z)
        np.testing.assert_allclose(moments[0], p, atol=1e-6)
        for order in (1, 2):
            for at, end in enumerate(p):
                whole = quad(
                    lambda q, k=order: float(self.distribution.quantile(np.array(q)) ** k), 0.0, end, limit=200
                )[0]
                np.testing.assert_allclose(moments[order][at], whole, atol=1e-5)

    def test_moments_are_those_of_the_whole(self) -> None:
        raw = self.distribution.raw_moments(2)
        assert raw.shape == (3,)
        end = np.array([self.distribution.support[1]])
        parts = [values[0] for values in self.distribution.partial_moments(end)]
        np.testing.assert_allclose(raw, parts, atol=1e-9)


# The contract of an effect.


COLUMNS = (
    Column("angle_deg", "deg", "", role=Role.ANGLE),
    Column("torque_Nm", "Nm", "", role=Role.TORQUE),
    Column("direction", "", "", role=Role.DIRECTION),
    Column("speed_rpm", "rpm", "", role=Role.SPEED),
    Column("temperature_C", "C", "", role=Role.TEMPERATURE),
    Column("time_s", "s", "", role=Role.TIME),
    Column("unit", "", "", text=True, role=Role.UNIT),
    Column("lot", "", "", text=True, role=Role.LOT),
    Column("payload_kg", "kg", "", role=Role.PAYLOAD),
)


class EffectContract:
    """What every `Effect` must keep, on a table that has all roles."""

    effect_type: ClassVar[type[Effect]]
    rows: ClassVar[int] = 50
    has_path: ClassVar[bool] = False
    """Whether a row depends on those before it."""

    def columns(self) -> tuple[Column, ...]:
        """The columns of the table that the effect is tested on."""
        return COLUMNS

    def table(self) -> dict[str, np.ndarray]:
        """Random rows of these columns."""
        rng, n = np.random.default_rng(5), self.rows
        numbers = {
            "angle_deg": rng.uniform(-180.0, 360.0, n),
            "torque_Nm": rng.uniform(-400.0, 400.0, n),
            "direction": rng.choice([-1.0, 1.0], n),
            "speed_rpm": rng.uniform(1.0, 30.0, n),
            "temperature_C": rng.uniform(15.0, 60.0, n),
            "time_s": rng.permutation(np.linspace(0.0, 3600.0, n)),
            "payload_kg": rng.uniform(0.0, 20.0, n),
        }
        labels = {"unit": [f"u{i}" for i in range(n)], "lot": rng.choice(["A", "B", "C"], n)}
        return numbers | {name: np.array(column, dtype=object) for name, column in labels.items()}

    def target(self, table: dict[str, np.ndarray] | None) -> Target:
        """What the effect acts on; override it for an effect of certain models only."""
        outputs = (Output("reading_arcsec", "arcsec", ""),)
        return replace(target_from("table", outputs, self.columns(), table), gear=RV_40E)

    def _bench(self) -> tuple[Effect, Measurements, Target]:
        table = self.table()
        target = self.target(table)
        return self.effect_type(), measurements_of(target.columns, table), target

    def _values(self, seed: int, zero: bool = False) -> dict[str, float]:
        effect, _, target = self._bench()
        shape, size = np.random.default_rng(7), np.random.default_rng(seed)
        numbers = effect.parameters(target)
        values = {n.name: _size(n, size) if n.linear else _inner(n, shape) for n in numbers}
        amplitudes = {n.name for n in numbers if n.linear} or {n.name for n in numbers}
        return values | (dict.fromkeys(amplitudes, 0.0) if zero else {})

    def _act(self, values: dict[str, float], rows: slice | np.ndarray = slice(None)) -> Action:
        effect, measurements, target = self._bench()
        part = measurements_of(target.columns, {k: v[rows] for k, v in measurements.table.items()})
        return effect.act(part, values, target)

    def test_says_what_it_is(self) -> None:
        effect = self.effect_type()
        assert effect.family in FAMILIES
        assert effect.cause.endswith(".") and effect.cause.count(".") == effect.cause.count(". ") + 1
        assert effect.formula and effect.reference
        assert effect.name not in effect.mistaken_for

    def test_applies_to_its_target_and_not_without_what_it_needs(self) -> None:
        effect, _, target = self._bench()
        assert effect.applies(target)
        for role in effect.needs if effect.place(target) is None else ():
            remaining = tuple(column for column in target.columns if column.role is not role)
            assert not effect.applies(replace(target, columns=remaining)), role

    def test_bounds(self) -> None:
        effect, _, target = self._bench()
        numbers = effect.parameters(target)
        assert numbers
        assert len({number.name for number in numbers}) == len(numbers)
        for number in numbers:
            assert number.low < number.high, number.name
            assert not number.linear or number.low <= 0.0 <= number.high, number.name
            assert all(number.low <= choice <= number.high for choice in number.choices), number.name
            assert effect.parameter(number.name, target) == number
            assert effect.parameter(number.stem, target) is not None

    def test_parameters_without_a_table_are_the_same_numbers(self) -> None:
        effect, _, target = self._bench()
        without = {number.name for number in effect.parameters(self.target(None))}
        assert {number.name for number in effect.parameters(target)} <= without or target.labels

    def test_acts_in_one_place(self) -> None:
        action = self._act(self._values(1))
        places = [place.name for place in fields(Action) if getattr(action, place.name)]
        assert len(places) == 1

    def test_nothing_at_zero(self) -> None:
        for name, column in _done(self._act(self._values(1, zero=True))).items():
            assert not np.any(column), name

    def test_shapes_and_finite(self) -> None:
        for name, column in _done(self._act(self._values(1))).items():
            assert column.shape == (self.rows,), name
            assert np.all(np.isfinite(column)), name
            assert np.any(column), name

    def test_linear_parameters_are_linear(self) -> None:
        effect, _, target = self._bench()
        linear = {number.name for number in effect.parameters(target) if number.linear}
        u, v = self._values(1), self._values(2)
        both = {k: 2.0 * u[k] + 3.0 * v[k] if k in linear else u[k] for k in u}
        done = [_done(self._act(values)) for values in (u, v, both)]
        for name in done[0] if linear else ():
            expected = 2.0 * done[0][name] + 3.0 * done[1][name]
            np.testing.assert_allclose(done[2][name], expected, rtol=1e-9, atol=1e-9)

    def test_batch_equals_row_by_row(self) -> None:
        values = self._values(1)
        action = self._act(values)
        row_wise = action.changes or action.output
        whole = _done(action) if row_wise and not self.has_path else {}
        for row in range(self.rows):
            single = _done(self._act(values, slice(row, row + 1))) if whole else {}
            for name, column in single.items():
                np.testing.assert_allclose(column[0], whole[name][row], rtol=1e-9, atol=1e-12)

    def test_picklable(self) -> None:
        again = pickle.loads(pickle.dumps(self.effect_type()))
        _, measurements, target = self._bench()
        values = self._values(1)
        expected = _done(self._act(values))
        for name, column in _done(again.act(measurements, values, target)).items():
            np.testing.assert_array_equal(column, expected[name])


def _size(number: EffectParameter, rng: np.random.Generator) -> float:
    low = number.low if isfinite(number.low) else -5.0
    return float(rng.uniform(low, min(number.high, low + 10.0)))


def _inner(number: EffectParameter, rng: np.random.Generator) -> float:
    if number.choices:
        return float(rng.choice(number.choices))
    low = number.low if isfinite(number.low) else -5.0
    return float(rng.uniform(0.1, 0.9) * (min(number.high, low + 10.0) - low) + low)


def _done(action: Action) -> dict[str, np.ndarray]:
    """What an action adds in every place, on outputs that are a ramp."""
    columns = {f"inside {name}": np.asarray(change) for name, change in action.changes.items()}
    columns |= {f"output {name}": change for name, change in action.output.items()}
    ramp = np.linspace(-1.0, 1.7, 50)
    columns |= {f"reading {name}": read(ramp) - ramp for name, read in action.reading.items()}
    if action.population:
        changed = action.population(ramp, 0.3, np.random.default_rng(9))
        columns["population"] = changed - ramp
    return columns


# The contract of a model.


class ModelContract:
    """What every `MeasurableModel` must keep at the rows of a table."""

    model_type: ClassVar[type[MeasurableModel]]

    def model(self) -> MeasurableModel:
        """The model that is tried; override it where the type needs parameters."""
        return self.model_type()

    def table(self) -> dict[str, np.ndarray]:
        """Rows (n,) of its columns: override it where they are not numbers in -1 to 1."""
        rng = np.random.default_rng(2)
        return {column.name: rng.uniform(-1.0, 1.0, 7) for column in self.model_type.columns}

    def _predicted(self, model: MeasurableModel, rows: slice = slice(None)) -> dict[str, np.ndarray]:
        part = {name: column[rows] for name, column in self.table().items()}
        return model.predict(part, np.random.default_rng(1))

    def test_declarations(self) -> None:
        kind = self.model_type
        names = [declared.name for declared in kind.columns] + [declared.name for declared in kind.outputs]
        assert len(set(names)) == len(names)
        for declared in (kind.columns, kind.outputs, kind.parameters):
            for unit in [entry.unit for entry in declared]:
                assert dimension(unit) is not None
        assert set(kind.free) <= {parameter.name for parameter in kind.parameters} or not kind.parameters

    def test_shapes_and_finite(self) -> None:
        predicted, n = self._predicted(self.model()), len(next(iter(self.table().values())))
        assert set(predicted) == {output.name for output in self.model_type.outputs}
        for name, values in predicted.items():
            assert values.shape == (n,), name
            assert np.all(np.isfinite(values)), name

    def test_same_generator_same_prediction(self) -> None:
        first, second = (self._predicted(self.model()) for _ in range(2))
        for name, values in first.items():
            np.testing.assert_array_equal(values, second[name])

    def test_batch_equals_row_by_row(self) -> None:
        if self.model_type.population:
            return
        model = self.model()
        for name, values in self._predicted(model).items():
            for row in range(len(values)):
                single = self._predicted(model, slice(row, row + 1))[name][0]
                np.testing.assert_allclose(single, values[row], rtol=1e-9, atol=1e-12)

    def test_picklable(self) -> None:
        again = pickle.loads(pickle.dumps(self.model()))
        for name, values in self._predicted(self.model()).items():
            np.testing.assert_array_equal(self._predicted(again)[name], values)


# The contract of a problem.


class ProblemContract:
    """What every `ToleranceProblem` must keep."""

    problem_type: ClassVar[type[ToleranceProblem]]

    def problem(self) -> ToleranceProblem:
        """The problem that is tried; override it where the type needs settings."""
        return self.problem_type()

    def _designs(self, count: int = 5) -> tuple[ToleranceProblem, np.ndarray]:
        problem = self.problem()
        rng = np.random.default_rng(0)
        return problem, rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))

    def test_bounds_are_finite_and_ordered(self) -> None:
        problem = self.problem()
        assert np.all(np.isfinite(problem.xl)) and np.all(problem.xl < problem.xu)

    def test_shapes(self) -> None:
        problem, x = self._designs()
        out = problem.evaluate(x, return_as_dictionary=True)
        assert out["F"].shape == (5, problem.n_obj)
        assert problem.n_ieq_constr == 0 or out["G"].shape == (5, problem.n_ieq_constr)

    def test_batch_equals_row_by_row(self) -> None:
        problem, x = self._designs()
        whole = problem.outputs_of(problem.complete(x))
        for row in range(len(x)):
            single = problem.outputs_of(problem.complete(x[row : row + 1]))
            for name, values in whole.items():
                np.testing.assert_allclose(single[name][0], values[row], rtol=1e-6, atol=1e-8)

    def test_finite_at_all_corners(self) -> None:
        problem = self.problem()
        signs = np.random.default_rng(1).integers(0, 2, size=(64, problem.n_var))
        x = np.vstack([problem.xl, problem.xu, np.where(signs == 1, problem.xu, problem.xl)])
        for name, values in problem.outputs_of(problem.complete(x)).items():
            assert np.all(np.isfinite(values)), name

    def test_picklable(self) -> None:
        problem, x = self._designs()
        again = pickle.loads(pickle.dumps(problem))
        np.testing.assert_array_equal(again.evaluate(x)[0], problem.evaluate(x)[0])

    def test_known_answer_is_a_front_or_none(self) -> None:
        problem = self.problem()
        front = problem.exact_front()
        assert front is None or front.shape[1] == problem.n_obj

    def test_box_is_a_box(self) -> None:
        ideal, nadir = self.problem().box()
        assert np.all(ideal < nadir)


# The contract of a problem that promises a yield on the basis of samples of its variables.


class PromisingContract(ProblemContract):
    """What every `Promising` problem must keep in addition to the contract of a problem."""

    def promising(self) -> Promising:
        """The problem that is tried, with an assured promise."""
        plain = self.problem()
        assert isinstance(plain, Promising)
        assured = type(plain)(replace(plain.given, promise=Promise(95.0, ASSURED)))
        assert isinstance(assured, Promising)
        return assured

    def _deviations(self, count: int = 5) -> tuple[Promising, np.ndarray, Deviations]:
        problem, rng = self.promising(), np.random.default_rng(3)
        x = rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))
        designs = problem.complete(x)
        return problem, designs, problem.deviations(designs)

    def test_deviations_are_of_its_variables_and_have_a_limit(self) -> None:
        problem, designs, deviations = self._deviations()
        assert deviations.sides
        assert set(deviations.each) <= set(problem.names)
        for values in (deviations.mean, deviations.rest, *deviations.each.values()):
            assert values.shape == (len(designs),) and np.all(np.isfinite(values))
        assert np.all(deviations.rest >= 0.0) and all(np.all(spread >= 0.0) for spread in deviations.each.values())

    def test_deviations_of_a_batch_are_those_of_its_rows(self) -> None:
        problem, designs, deviations = self._deviations()
        for row in range(len(designs)):
            single = problem.deviations(designs[row : row + 1])
            np.testing.assert_allclose(single.mean, deviations.mean[row], rtol=1e-9)
            for name, values in deviations.each.items():
                np.testing.assert_allclose(single.each[name], values[row], rtol=1e-9)

    def test_the_promised_yield_is_the_output(self) -> None:
        problem, designs, deviations = self._deviations()
        promised = problem.promised
        assert promised is not None
        outputs = problem.outputs_of(designs)
        np.testing.assert_allclose(outputs[PROMISED], promised.promised(deviations), atol=1e-9)

    def test_fewer_parts_promise_less(self) -> None:
        """The same estimates from 8 and from 80 parts."""
        problem, _, deviations = self._deviations()
        promise = problem.promise
        assert promise is not None
        yields = []
        for n in (8, 80):
            known = {name: Knowledge(0.0, 1.0, n, n - 1.0) for name in deviations.each}
            yields.append(PromisedOutput(promise, known, 0).promised(deviations))
        assert np.all(yields[0] <= yields[1] + 1e-9)


# The contract of a rule of choice.


def front(objectives: int) -> Points:
    """Points on a part of a sphere: a front with the best of each objective at one end."""
    angles = np.random.default_rng(3).uniform(0.05, 0.95, (60, objectives)) * np.pi / 2.0
    values = np.abs(np.cos(angles)) / np.linalg.norm(np.cos(angles), axis=1, keepdims=True)
    values = 2.0 - values
    names = (COST, *(f"error_{at}" for at in range(1, objectives)))
    weights = np.arange(1.0, objectives + 1.0)
    kept = values[:, 1] <= np.median(values[:, 1])
    return Points(values, names, values[:, 0], weights / weights.sum(), kept, 1.4)


class RuleContract:
    """What every `ChoiceRule` must keep, on fronts of two and three objectives."""

    rule_type: ClassVar[type[ChoiceRule]]

    def test_is_registered_and_says_what_it_chooses(self) -> None:
        assert RULE_KINDS[RULE_KINDS.name_of(self.rule_type)] is self.rule_type
        assert self.rule_type.meaning.strip()

    def test_chooses_a_row_of_the_front_or_none(self) -> None:
        for count in (2, 3):
            points = front(count)
            row = self.rule_type().row(points)
            assert row is None or 0 <= int(row) < len(points.objectives)

    def test_applies_to_two_or_to_three_objectives(self) -> None:
        assert any(self.rule_type().row(front(count)) is not None for count in (2, 3))

    def test_same_front_same_choice_and_the_front_stays(self) -> None:
        points = front(3)
        before = points.objectives.copy()
        assert self.rule_type().row(points) == self.rule_type().row(points)
        np.testing.assert_array_equal(points.objectives, before)

    def test_two_points_and_equal_points_are_no_fault(self) -> None:
        whole = front(2)
        for rows in ([0, 1], [0, 0, 0]):
            points = Points(whole.objectives[rows], whole.names, whole.objectives[rows, 0], whole.weights)
            row = self.rule_type().row(points)
            assert row is None or 0 <= int(row) < len(rows)


# The contract of a section of the page of a run.


VOID = frozenset(
    ["area", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr", "path", "circle", "line", "rect"]
)


@cache
def example() -> RunResult:
    """The result of a small run: two parts, cost against variation."""
    from .api import run

    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    parts = [
        {"name": name, "nominal": 10.0, "unit": "mm", "sensitivity": 1.0, "t_min": 0.01, "t_max": 0.1, "cost": cost}
        for name in ("pin", "bore")
    ]
    finished = run(
        {
            "problem": "stack",
            "objectives": {"minimise": ["cost", "variation"]},
            "requirement": {"name": "play", "unit": "mm", "nominal": 20.0},
            "part": parts,
            "algorithm": {"name": "exact", "points": 20},
        }
    )
    assert isinstance(finished.record, RunResult)
    return finished.record


class _Tags(HTMLParser):
    """Tags that are open at the end, and those that were closed without having been opened."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


class PageContract:
    """What every `PageSection` must keep, on the result of a small run and on one without points.

    `result` may be another result, one for which the section has something to show.
    """

    section_type: ClassVar[type[PageSection]]

    def result(self) -> RunResult:
        """The result for which the section is not empty."""
        return example()

    def test_is_registered_and_has_a_title(self) -> None:
        assert SECTIONS[SECTIONS.name_of(self.section_type)] is self.section_type
        assert self.section_type.title.strip()

    def test_is_well_formed(self) -> None:
        body = self.section_type().body(self.result())
        assert body
        tags = _Tags()
        tags.feed(body)
        assert (tags.open, tags.wrong) == ([], [])

    def test_loads_nothing_and_runs_nothing(self) -> None:
        body = self.section_type().body(self.result())
        assert re.search(r"<script|<iframe|(src|href)=[\"']?(https?:)?//|\son\w+=", body) is None

    def test_same_result_same_text(self) -> None:
        section = self.section_type()
        assert section.body(self.result()) == section.body(self.result())

    def test_a_result_without_points_is_no_fault(self) -> None:
        whole = self.result()
        none = replace(whole, front=whole.front[:0], references=whole.references[:0])
        assert isinstance(self.section_type().body(none), str)
