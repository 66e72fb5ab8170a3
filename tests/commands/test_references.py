"""Allocations of the documents beside a front: gains and distances by hand."""

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.run.references import DISTANCE, compare, distance, documents
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_transmission_error import RvTransmissionError
from tolevo.problems.tolerance_problem import ToleranceProblem

FRONT = np.array([[1.0, 10.0], [2.0, 5.0], [4.0, 1.0]])


@pytest.mark.parametrize(
    ("own", "wanted"), [((2.0, 5.0), 0.0), ((2.5, 5.0), 0.125), ((4.0, 3.0), 0.1), ((1.0, 14.0), 0.2)]
)
def test_distance_is_in_sides_of_the_box(own: tuple[float, float], wanted: float) -> None:
    """Sides 4 and 20: half a cost unit is 0.125, two units of the other objective are 0.1."""
    found = distance(np.array(own), FRONT, np.array([4.0, 20.0]))
    np.testing.assert_allclose(found, wanted)


def test_distance_to_nothing_is_unknown() -> None:
    assert np.isnan(distance(np.ones(2), np.empty((0, 2)), np.ones(2)))


@pytest.mark.parametrize(
    ("kind", "labels"),
    [
        (RvBacklash, ["document B", "document B, staggered 0.2 arcmin (delta' = 0.1)"]),
        (RvTransmissionError, ["document A, Q = 0", "document A, Q = 5", "document A, Q = 10"]),
    ],
)
def test_documents_stand_beside_the_front_with_both_figures(kind: type[ToleranceProblem], labels: list[str]) -> None:
    """A front that is a tenth cheaper and no worse than each: 10 % saved, and as far as that is."""
    problem = kind()
    printed = documents(problem)
    names = list(problem.objectives)
    assert printed["label"].tolist() == labels
    assert np.isfinite(printed[names].to_numpy()).all()
    front = printed[names].assign(cost=0.9 * printed["cost"])
    found = compare(printed, front, {}, problem)
    assert np.all(found["cost_saving_percent"] >= 10.0 - 1e-9)
    ideal, nadir = problem.box()
    side = (nadir - ideal)[names.index("cost")]
    assert np.all(found[DISTANCE] <= 0.1 * printed["cost"] / side + 1e-12)
    one = compare(printed.iloc[:1], front.iloc[:1], {}, problem)
    np.testing.assert_allclose(one[DISTANCE], 0.1 * printed["cost"].iloc[0] / side)
    assert np.isnan(found[f"relaxed_{DISTANCE}"]).all()


def test_document_m_prints_no_allocation_and_its_search_stands_in() -> None:
    """Its table is lost: the genetic algorithm with its settings takes the place."""
    problem = PoseAccuracy()
    assert documents(problem).empty
    optimum = problem.least_cost()
    assert optimum is not None
    assert "the document's allocation, which is lost" in optimum[0]
    front = pd.DataFrame({"cost": [10.0], "squareness_mrad": [0.1]})
    one = pd.DataFrame({"label": ["x"], "cost": [20.0], "squareness_mrad": [0.1]})
    found = compare(one, front, {"x": front}, problem)
    assert found["cost_saving_percent"].tolist() == [50.0]
    assert found[DISTANCE].tolist() == found[f"relaxed_{DISTANCE}"].tolist()
