"""The front with a reference's looser limits has the least cost at the reference's own other value."""

import numpy as np

from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.commands.run.front import reported_front
from tolevo.commands.run.references import documents, relaxed_bounds, with_least_cost
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, Settings


def test_saving_does_not_hang_on_where_points_of_the_front_fall() -> None:
    settings = Settings(objectives=("cost", "backlash_arcmin"), limits={"interference_probability": Bound(high=0.05)})
    problem = RvBacklash(settings)
    row = documents(problem).iloc[0].to_dict()
    looser = problem.relaxed(relaxed_bounds(problem, row))
    level = float(row["backlash_arcmin"])
    saved = []
    for points in (5, 8):
        front = reported_front(looser, search(looser, Exact(points=points), Budget(), 1))
        joint = with_least_cost(front, looser, "backlash_arcmin", level)
        saved.append(float(joint.loc[joint["backlash_arcmin"] <= level, "cost"].min()))
        assert list(joint.columns) == list(front.columns)
        assert saved[-1] < front.loc[front["backlash_arcmin"] <= level, "cost"].min()
    np.testing.assert_allclose(saved[0], saved[1], rtol=1e-9)
