"""Our own cost curves, distributions and models keep the contracts that plugins inherit."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.commands.study.designs import Factorial, LatinHypercube, Morris, Sobol
from tolevo.commands.study.plan import Factor
from tolevo.errors import InputError
from tolevo.models import inputs
from tolevo.models.costs import (
    CURVES,
    Combined,
    CostCurve,
    Exponential,
    Reciprocal,
    ReciprocalPower,
    ReciprocalSquared,
    Table,
)
from tolevo.models.inputs import DISTRIBUTIONS, Beta, LogNormal, Normal, Rayleigh, Triangular, Uniform
from tolevo.models.rv_reducer.lost_motion import RvLostMotion
from tolevo.section import Array
from tolevo.testing import CurveContract, DesignContract, DistributionContract, ModelContract


class TestReciprocal(CurveContract):
    curve = Reciprocal(1.0, 2.0)


class TestReciprocalSquared(CurveContract):
    curve = ReciprocalSquared(0.5, 3.0)


class TestReciprocalPower(CurveContract):
    curve = ReciprocalPower(0.1, 2.0, 0.7)


class TestExponential(CurveContract):
    curve = Exponential(1.0, 4.0, 0.3)


class TestCombined(CurveContract):
    curve = Combined(0.2, 1.5, 1.3, 2.0, 0.4)


class TestTable(CurveContract):
    curve = Table((0.01, 0.1, 0.4, 1.0), (9.0, 5.0, 2.0, 1.9))


class TestUniform(DistributionContract):
    distribution = Uniform()


class TestNormal(DistributionContract):
    distribution = Normal(cp=1.33, shift=0.2)


class TestTriangular(DistributionContract):
    distribution = Triangular(0.4)


class TestBeta(DistributionContract):
    distribution = Beta(2.0, 3.0)


class TestRayleigh(DistributionContract):
    distribution = Rayleigh(0.3)


class TestExponentialLaw(DistributionContract):
    distribution = inputs.Exponential()


class TestLogNormal(DistributionContract):
    distribution = LogNormal(0.4)


class TestLostMotion(ModelContract):
    model_type = RvLostMotion

    def table(self) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(2)
        numbers = {one.name: rng.uniform(20.0, 100.0, 7) for one in self.model_type.columns}
        return numbers | {"direction": rng.choice([-1.0, 1.0], 7)}


class Rising(CostCurve):
    """A curve that breaks the contract: its slope has the wrong sign."""

    def cost(self, t: Array) -> Array:
        return 1.0 / t

    def slope(self, t: Array) -> Array:
        return 1.0 / t**2


def test_a_contract_can_fail() -> None:
    broken = CurveContract()
    broken.curve = Rising()  # type: ignore[misc]
    with pytest.raises(AssertionError):
        broken.test_slope_is_that_of_the_cost()
    with pytest.raises(LookupError, match=r"not an entry point of tolevo\.curves"):
        broken.test_is_registered_and_comes_back_from_its_table()


def test_names_that_are_none() -> None:
    assert "nonsense" not in CURVES
    with pytest.raises(KeyError):
        DISTRIBUTIONS["nonsense"]
    assert set(CURVES.sound()) == set(CURVES)


def test_a_plugin_that_is_no_curve_stops_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    from tolevo import registry

    real = registry._member

    def member(module: object, path: list[str]) -> object:
        return int if path == ["Table"] else real(module, path)

    monkeypatch.setattr(registry, "_member", member)
    with pytest.raises(InputError, match="must be a subclass of CostCurve"):
        CURVES["table"]
    assert set(CURVES.sound()) == set(CURVES) - {"table"}
    assert CURVES.name_of(Reciprocal) == "reciprocal"


class TestFactorial(DesignContract):
    design = Factorial()
    factors = (
        Factor("algorithm.population", low=20.0, high=80.0, integer=True, count=3),
        Factor("algorithm.crossover.eta", levels=(5.0, 15.0, 30.0)),
    )


class TestLatinHypercube(DesignContract):
    design = LatinHypercube(64)


class TestMorris(DesignContract):
    design = Morris(10)


class TestSobol(DesignContract):
    design = Sobol(128)
