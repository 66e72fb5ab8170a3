"""The Python interface: what the commands do, without the command line."""

from __future__ import annotations

from .configuration import read
from .workflows.evaluate import evaluate
from .workflows.run import run
from .workflows.simulate import simulate

__all__ = ["evaluate", "read", "run", "simulate"]
