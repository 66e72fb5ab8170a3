"""Optional interfaces of a problem: their defaults, and members that would never be asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tolevo.models.costs import Reciprocal
from tolevo.problems import interfaces
from tolevo.problems.declaration import Declaration
from tolevo.problems.interfaces import Differentiable, Drawing, Interface, Page, Provable, Stored
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
MEMBERS = sorted(Interface.owners)


class Bore(ToleranceProblem):
    """No more than a problem has to give."""

    declaration = DECLARATION

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        return {"cost": self.cost_of(designs), "play_um": 2.0 * designs[:, 0]}


class SlopedBore(Bore, Differentiable):
    """One that gives derivatives as well."""

    def gradient(self, designs: Array) -> dict[str, Array]:
        return {"play_um": np.full(designs.shape, 2.0)}


def test_a_problem_of_one_function_has_the_defaults_of_every_interface() -> None:
    problem = Bore(Settings(labels=Labels(name="bearing seat")))
    design = np.array([[2.0]])
    assert Page.of(problem).title() == "bearing seat"
    assert Drawing.of(problem).room("bore_um", design[0]) == (1.0, 10.0)
    assert Drawing.of(problem).zone("bore_um") == (None, 0.5)
    assert Differentiable.of(problem).gradient(design) == {}
    # C = 1 + 4/t: C' = -4/t^2 = -1 at t = 2
    np.testing.assert_allclose(Differentiable.of(problem).cost_slopes(design), [[-1.0]])
    assert Differentiable.of(problem).starts().shape == (0, 1)
    assert Provable.of(problem).form() is None
    assert Provable.of(problem).stand_in_limit("play_um", 3.0) == 3.0
    assert Stored.of(problem).kept() == {}


def test_a_problem_that_inherits_an_interface_is_asked_itself() -> None:
    problem = SlopedBore()
    assert Differentiable.of(problem) is problem
    slopes = Differentiable.of(problem).gradient(np.array([[2.0], [3.0]]))
    np.testing.assert_array_equal(slopes["play_um"], [[2.0], [2.0]])
    assert Provable.of(problem) is not problem


@pytest.mark.parametrize("member", MEMBERS)
def test_a_member_without_its_interface_is_refused(member: str) -> None:
    owner = Interface.owners[member].__name__
    with pytest.raises(TypeError, match=f"Lost.{member} belongs to the interface {owner}"):
        type("Lost", (Bore,), {member: lambda self: None})


@pytest.mark.parametrize("name", sorted(MOVED))
def test_what_a_declaration_holds_is_no_attribute_of_a_class(name: str) -> None:
    with pytest.raises(TypeError, match=f"Old.{name} belongs to its `declaration`"):
        type("Old", (Bore,), {name: ()})
    assert MOVED[name] in Declaration.__dataclass_fields__


def test_no_interface_has_more_than_a_dozen_members_and_none_is_lost() -> None:
    owners = list(Interface.owners.values())
    assert max(owners.count(owner) for owner in owners) <= 12
    public = set(interfaces.__all__) - {"Interface", "Variant", "refuse_lost_members"}
    assert {owner.__name__ for owner in owners} == public
    assert not set(Interface.owners) & set(vars(ToleranceProblem))
