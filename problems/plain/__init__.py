"""A plain pymoo problem as a problem of this suite."""

from .kind import PlainKind, plain_kind
from .problem import PlainProblem

__all__ = ["PlainKind", "PlainProblem", "plain_kind"]
