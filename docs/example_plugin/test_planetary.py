"""The contracts that its five plugins keep, and what they do together."""

import numpy as np
import pandas as pd
import tolevo
from tolevo.testing import AlgorithmContract
from tolevo.testing import CurveContract
from tolevo.testing import EffectContract
from tolevo.testing import ModelContract
from tolevo.testing import ProblemContract
from tolevo_planetary import LatinHypercube, Logarithmic, PinBending, PlanetaryStage, PlanetaryTolerances

RUN = {
    "problem": "planetary_tolerances",
    "parameters": {"radius": "31 mm"},
    "costs": {"sun_um": {"model": "logarithmic", "a": 7.0, "b": 1.2}},
    "algorithm": {"name": "latin_hypercube", "population": 20, "generations": 3},
}


class TestStage(ModelContract):
    model_type = PlanetaryStage


class TestTolerances(ProblemContract):
    problem_type = PlanetaryTolerances


class TestBending(EffectContract):
    effect_type = PinBending


class TestCurve(CurveContract):
    curve = Logarithmic(6.0, 1.0)
    low, high = 2.0, 60.0


class TestLatinHypercube(AlgorithmContract):
    settings = LatinHypercube(population=20)

    def problem(self):
        return PlanetaryTolerances()


def test_a_run_by_configuration():
    front = tolevo.run(RUN).front
    sun, planet, ring = (front[f"{gear}_um"] for gear in ("sun", "planet", "ring"))
    expected = 7.0 - 1.2 * np.log(sun) + 12.0 - np.log(planet) - np.log(ring)
    np.testing.assert_allclose(front["cost"], expected, rtol=1e-12)
    assert 'model = "logarithmic"' in tolevo.check(RUN)


def test_the_effect_is_found_in_measured_data():
    rng = np.random.default_rng(0)
    torque = rng.uniform(-60.0, 60.0, 300)
    twist = np.sign(torque) + torque / 12.0 + 4e-4 * torque * np.abs(torque)
    data = pd.DataFrame({"torque_Nm": torque, "twist_arcmin": twist + rng.normal(0.0, 0.02, len(torque))})
    found = tolevo.gap({"model": "planetary_stage", "settings": {"bootstrap": 0}}, data).record
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["pin_bending"]
    bending = found.effects[0].parameters[0]
    assert bending.low < 4e-4 < bending.high
