"""What a template is filled with: the problem and the model of a configuration."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from ..errors import nearest, refuse
from ..registry import load
from ..workflows.template import KINDS, template
from .reader import read

DEFAULT = "rv40e_backlash.toml"
"""The configuration whose variables fill a template where none is named."""


def written(kind: str, config: Path | None = None) -> str:
    """The text of a template. Raises InputError where the kind is not known."""
    if kind not in KINDS:
        raise refuse("KIND", f'must be one of {", ".join(KINDS)}, got "{kind}"{nearest(kind, KINDS)}')
    configuration = read(config or Path(str(files("tolevo.configs"))) / DEFAULT)
    if configuration.problem is None:
        raise refuse("--config", "needs a problem: a model alone has no variables")
    return template(kind, configuration.problem, load("models", "rv_batch")())
