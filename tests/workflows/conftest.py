"""Runs in tests prove few points of a front with a solution of their own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tolevo.algorithms.exact import between


@pytest.fixture(scope="session", autouse=True)
def few_points_are_solved() -> Iterator[None]:
    """The bounds of other points come from their neighbours' prices: as valid, but less tight."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(between, "SOLVED", 4)
        yield
