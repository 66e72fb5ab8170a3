"""The common base of the optional interfaces of a problem."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Self, cast

if TYPE_CHECKING:
    from ..tolerance_problem import ToleranceProblem


class Interface:
    """What a problem may provide in addition to its outputs; every member has a default.

    A problem inherits the interface to replace members. Callers ask `Interface.of(problem)` and
    need not know whether it does.
    """

    owners: ClassVar[dict[str, type[Interface]]] = {}
    """The interface of each public member."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if Interface in cls.__bases__:
            members = (name for name in vars(cls) if not name.startswith("_"))
            Interface.owners |= dict.fromkeys(members, cls)

    @classmethod
    def of(cls, problem: ToleranceProblem) -> Self:
        """The problem itself where it implements the interface, otherwise the defaults for it."""
        if isinstance(problem, cls):
            return problem
        defaults = cls()
        defaults.__dict__["_described"] = problem
        return defaults

    @property
    def _problem(self) -> ToleranceProblem:
        """The problem that the interface belongs to."""
        return cast("ToleranceProblem", self.__dict__.get("_described", self))


def refuse_lost_members(problem_class: type) -> None:
    """Raises TypeError where a class of problems defines a member of an interface that it does not
    inherit: it would never be asked for.
    """
    for name in vars(problem_class):
        owner = Interface.owners.get(name)
        if owner is not None and not issubclass(problem_class, owner):
            raise TypeError(
                f"{problem_class.__name__}.{name} belongs to the interface {owner.__name__}: "
                f"inherit {owner.__name__} as well"
            )
