"""Transmission error of an RV reducer against manufacturing cost and adjustment effort."""

from __future__ import annotations

from .problem import RvTransmissionError

__all__ = ["RvTransmissionError"]
