"""The contract of an effect."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from math import isfinite
from typing import ClassVar

import numpy as np

from ..declarations import Output
from ..models.effects.effect import FAMILIES, Action, Effect, EffectParameter, Measurements, Target
from ..models.effects.measurements import measurements_of, target_from
from ..models.gear import RV_40E
from ..models.measurable import Column, Role

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
