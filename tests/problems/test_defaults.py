"""What a problem may provide beyond its outputs: the defaults, and what is asked where a class replaces them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo import plugins
from tolevo.models.costs import Reciprocal
from tolevo.problems.declaration import Declaration
from tolevo.problems.settings import Labels, Settings
from tolevo.problems.tolerance_problem import MOVED, ToleranceProblem
from tolevo.section import Kind, Output, Variable

Array = np.ndarray[Any, np.dtype[np.float64]]
DECLARATION = Declaration(
    (Variable("bore_um", "um", Kind.HALF_WIDTH, 1.0, 10.0, "bore", mid=0.5),),
    (Output("cost", "", "cost"), Output("play_um", "um", "play")),
    costs={"bore_um": Reciprocal(1.0, 4.0)},
    objectives=("cost", "play_um"),
)


class Bore(ToleranceProblem):
    """No more than a problem has to give."""

    declaration = DECLARATION

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        return {"cost": self.cost_of(designs), "play_um": 2.0 * designs[:, 0]}


class SlopedBore(Bore):
    """One that gives derivatives as well."""

    def gradient(self, designs: Array) -> dict[str, Array]:
        return {"play_um": np.full(designs.shape, 2.0)}


def test_a_problem_of_one_function_has_the_defaults_of_every_method() -> None:
    problem = Bore(Settings(labels=Labels(name="bearing seat")))
    design = np.array([[2.0]])
    assert problem.title() == "bearing seat"
    assert problem.room("bore_um", design[0]) == (1.0, 10.0)
    assert problem.zone("bore_um") == (None, 0.5)
    assert problem.gradient(design) == {}
    # C = 1 + 4/t: C' = -4/t^2 = -1 at t = 2
    np.testing.assert_allclose(problem.cost_slopes(design), [[-1.0]])
    assert problem.starts().shape == (0, 1)
    assert problem.form() is None
    assert problem.stand_in_limit("play_um", 3.0) == 3.0
    assert problem.kept() == {}


def test_a_problem_that_replaces_a_method_is_asked_itself() -> None:
    slopes = SlopedBore().gradient(np.array([[2.0], [3.0]]))
    np.testing.assert_array_equal(slopes["play_um"], [[2.0], [2.0]])


@pytest.mark.parametrize("name", sorted(MOVED))
def test_what_a_declaration_holds_is_no_attribute_of_a_class(name: str) -> None:
    with pytest.raises(TypeError, match=f"Old.{name} belongs to its `declaration`"):
        type("Old", (Bore,), {name: ()})
    assert MOVED[name] in Declaration.__dataclass_fields__


@pytest.mark.parametrize("name", ["Provable", "Differentiable", "Page"])
def test_classes_that_a_problem_had_to_inherit_can_still_be_named(name: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{name} is not needed any more"):
        former = getattr(plugins, name)
    problem = type("Old", (SlopedBore, former), {})()
    np.testing.assert_array_equal(problem.gradient(np.array([[2.0]]))["play_um"], [[2.0]])
    with pytest.raises(AttributeError, match="no attribute 'Lost'"):
        plugins.__getattr__("Lost")
