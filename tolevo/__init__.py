"""Tolerance allocation for mechanisms; everything here is imported when it is first used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lazy import Renamed, lazily

__all__ = [
    "Analysis",
    "ConfigurationError",
    "Gap",
    "Reproduction",
    "Run",
    "Study",
    "__version__",
    "algorithms",
    "analyse",
    "ask",
    "certify",
    "check",
    "evaluate",
    "gap",
    "read",
    "read_aqdef",
    "read_table",
    "report",
    "reproduce",
    "run",
    "search",
    "simulate",
    "study",
    "tell",
]

if TYPE_CHECKING:
    from typing import Final

    from . import algorithms
    from .api import (
        analyse,
        ask,
        certify,
        check,
        evaluate,
        gap,
        read,
        report,
        reproduce,
        run,
        search,
        simulate,
        study,
        tell,
    )
    from .errors import ConfigurationError
    from .results import Analysis, Gap, Reproduction, Run, Study
    from .tables import read_aqdef, read_table

    __version__: Final[str] = ""

_ROOMS = {
    ".api": (
        "analyse",
        "ask",
        "certify",
        "check",
        "evaluate",
        "gap",
        "read",
        "report",
        "reproduce",
        "run",
        "search",
        "simulate",
        "study",
        "tell",
    ),
    ".errors": ("ConfigurationError",),
    ".results": ("Analysis", "Gap", "Reproduction", "Run", "Study"),
    ".tables": ("read_aqdef", "read_table"),
}
_PLACES = {name: room for room, names in _ROOMS.items() for name in names} | {"algorithms": ""}

_RENAMED = dict[str, Renamed]()
"""Public names that were replaced: they work, with a warning, for two minor versions."""


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # type checkers know the names above, and no others
    _lazy = lazily(__name__, _PLACES, _RENAMED)

    def __getattr__(name):
        if name == "__version__":
            from importlib.metadata import version

            return version("tolevo")
        return _lazy(name)
