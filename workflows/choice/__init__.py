"""Which point of a front to build: named rules, how sure they are, and what can be ordered."""

from __future__ import annotations

from .settings import ChoiceSettings

__all__ = ["ChoiceSettings"]
