"""The contract of a design of experiments."""

from __future__ import annotations

from dataclasses import fields
from typing import ClassVar

import numpy as np
import pandas as pd

from ..configuration.search import settings_of
from ..errors import Fault
from ..section import Section
from ..workflows.study.designs import DESIGNS
from ..workflows.study.records import Design, Factor, Level

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
