"""How a problem is written back as a configuration, and what a run stores of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...arrays import Array
from .base import Interface


class Written(Interface):
    """Tables of a configuration that the problem reads itself."""

    def tables(self) -> dict[str, Any]:
        """The top-level tables that the problem is written in, where `configured` reads them.

        They take the place of parameters, variables, costs and propagation.
        """
        return {}

    def more_tables(self) -> dict[str, Any]:
        """Top-level tables that `configured` reads in addition to the usual ones."""
        return {}


class Stored(Interface):
    """Arrays that took long to compute, which a run stores with its results."""

    def kept(self) -> dict[str, Array]:
        """Arrays by name that took long to compute and depend on the configuration alone."""
        return {}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take what another process has `kept`; whether it belongs to this configuration."""
        return False
