"""A configuration that has been read, checked and completed."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import tomli_w

from ..algorithms.settings import AlgorithmSettings, Budget
from ..problems.settings import Settings
from ..workflows.choice.settings import ChoiceSettings

if TYPE_CHECKING:
    from ..problems.tolerance_problem import ToleranceProblem
    from ..workflows.run.plan import RunPlan


@dataclass(frozen=True)
class Configuration:
    """The contents of a TOML file.

    `problem` and `algorithm` are None where the configuration is `model = "..."` alone. `resolved`
    holds every value, defaults included: reading it again gives the same configuration.
    """

    model_name: str
    settings: Settings
    references: str = "documents"
    problem_name: str = ""
    problem: ToleranceProblem | None = None
    algorithm_name: str = ""
    algorithm: AlgorithmSettings | None = None
    engine: str = "pymoo"
    budget: Budget = field(default_factory=Budget)
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    resolved: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def plan(self) -> RunPlan:
        """The plan of `tolevo run`. The configuration must have a problem."""
        from ..workflows.run.plan import RunPlan

        assert self.problem is not None
        assert self.algorithm is not None
        return RunPlan(
            problem=self.problem,
            algorithm=self.algorithm,
            budget=self.budget,
            seed=self.seed,
            references=self.references != "none",
            reference_search=self.references == "ga",
            configuration=self.toml(),
            title=self.problem_name,
            engine=self.engine,
            choice=self.choice,
        )

    @property
    def seed(self) -> int:
        """The seed of everything random."""
        return self.settings.seed

    def toml(self) -> str:
        """The resolved configuration as TOML."""
        return tomli_w.dumps(dict(self.resolved))

    def tables(self) -> dict[str, Any]:
        """The resolved configuration as in a file; an object in the place of a name is kept."""
        read = tomllib.loads(self.toml())
        original = {"problem": self.resolved["problem"]} if "problem" in self.resolved else {}
        return read | original

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the resolved configuration."""
        return hashlib.sha256(self.toml().encode()).hexdigest()
