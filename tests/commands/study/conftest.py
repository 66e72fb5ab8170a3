from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from tolevo.commands.study.plan import Design, Factor, Level, StudyData, StudySettings
from tolevo.commands.study.trial import Curves

Array = NDArray[np.float64]
Effect = Callable[[pd.DataFrame], Array]
"""The true response of settings, without noise."""


class Synthetic:
    """Studies whose truth is given: effect(settings) + common + noise * N(0, 1) of every run.

    `common` is what a seed does alike at every setting.
    """

    def settings(
        self,
        design: Design,
        factors: tuple[Factor, ...],
        seeds: int,
        base: Mapping[str, Level] | None = None,
        response: str = "gap_percent",
    ) -> StudySettings:
        return StudySettings("synthetic", factors, design, (response,), seeds, 0, base or {}, ("cost",))

    def data(
        self, settings: StudySettings, effect: Effect, noise: float, rng: np.random.Generator, common: float = 0.0
    ) -> StudyData:
        frame = settings.design.points(settings.factors, settings.base, rng)
        truth = effect(frame)
        values = truth[:, None] + common * rng.normal(size=settings.seeds)
        values = values + noise * rng.normal(size=values.shape)
        return StudyData(self.table(settings, frame, values), frame, CURVES, exact(len(frame)))

    def table(self, settings: StudySettings, frame: pd.DataFrame, values: Array) -> pd.DataFrame:
        points, replicates = values.shape
        at = np.repeat(np.arange(points), replicates)
        table = pd.DataFrame({"point": at, "replicate": np.tile(np.arange(replicates), points)})
        for factor in settings.factors:
            table[factor.key] = frame[factor.key].to_numpy()[at]
        table["seed"], table["status"], table["reason"] = table["replicate"] + 100, "done", ""
        table[settings.responses[0]] = values.ravel()
        return table


CURVES = Curves()


def exact(points: int) -> pd.DataFrame:
    return pd.DataFrame({"point": np.arange(points), "value": 1.0})


@pytest.fixture
def synthetic() -> Synthetic:
    return Synthetic()
