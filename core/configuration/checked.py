"""`tolevo check`: a configuration of any kind, validated, and the text that states all of it."""

from __future__ import annotations

from collections.abc import Sequence

from ..problems.interfaces import Accuracy
from ..workflows.run.reach import searchable
from .description import describe, describe_plan
from .gap import is_gap, read_gap
from .reader import read
from .simulated import build_model
from .source import Source
from .study import is_study, read_study

CHECKED = 300
"""Settings of a study that are read as runs: reading all of them would take too long."""


def checked(source: Source, overrides: Sequence[str] = ()) -> str:
    """The resolved configuration as TOML with comments. Raises InputError with every fault."""
    if is_study(source):
        return describe_plan(read_study(source, overrides, CHECKED))
    if is_gap(source):
        return read_gap(source, overrides).configuration
    configuration = read(source, overrides)
    if configuration.problem is None:
        build_model(configuration)  # raises faults that only the physics of the model can detect
    else:
        coarser = Accuracy.of(configuration.problem).coarser()  # whatever its size, in seconds
        searchable(coarser, configuration.algorithm)
    return describe(configuration)
