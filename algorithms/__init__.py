"""Optimisers through pymoo, the search loop, and indicators.

The settings of every algorithm of the suite are here by the name of their class; each is imported
when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .age_moea2 import AGEMOEA2
    from .exact.solver import Exact
    from .ga import GA
    from .gde3 import GDE3
    from .hybrid import Hybrid
    from .nsga2 import NSGA2
    from .nsga3 import NSGA3
    from .random_search import RandomSearch
    from .settings import Crossover, Mutation
    from .sms_emoa import SMSEMOA

__all__ = [
    "AGEMOEA2",
    "GA",
    "GDE3",
    "NSGA2",
    "NSGA3",
    "SMSEMOA",
    "Crossover",
    "Exact",
    "Hybrid",
    "Mutation",
    "RandomSearch",
]

_PLACES = {
    "AGEMOEA2": ".age_moea2",
    "Crossover": ".settings",
    "Exact": ".exact.solver",
    "GA": ".ga",
    "GDE3": ".gde3",
    "Hybrid": ".hybrid",
    "Mutation": ".settings",
    "NSGA2": ".nsga2",
    "NSGA3": ".nsga3",
    "RandomSearch": ".random_search",
    "SMSEMOA": ".sms_emoa",
}


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # type checkers know the names above, and no others
    __getattr__ = lazily(__name__, _PLACES)
