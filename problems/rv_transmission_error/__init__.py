"""Transmission error of an RV reducer against manufacturing cost and adjustment effort."""

from .problem import RvTransmissionError

__all__ = ["RvTransmissionError"]
