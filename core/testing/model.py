"""The contract of a model."""

from __future__ import annotations

import pickle
from typing import ClassVar

import numpy as np

from ..models.measurable import MeasurableModel
from ..units import dimension


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
