"""The Python interface: what the commands do, without the command line."""

from __future__ import annotations

from .configuration import read
from .configuration.claims import read_claims
from .configuration.study import read_study
from .workflows.evaluate import evaluate
from .workflows.reproduce.reproduce import reproduce
from .workflows.run import run
from .workflows.simulate import simulate
from .workflows.study import study

__all__ = [
    "evaluate",
    "read",
    "read_claims",
    "read_study",
    "reproduce",
    "run",
    "simulate",
    "study",
]
