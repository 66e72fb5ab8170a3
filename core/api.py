"""The Python interface: what the commands do, without the command line."""

from __future__ import annotations

from .configuration import read
from .configuration.study import read_study
from .workflows.evaluate import evaluate
from .workflows.run import run
from .workflows.simulate import simulate
from .workflows.study import study

__all__ = ["evaluate", "read", "read_study", "run", "simulate", "study"]
