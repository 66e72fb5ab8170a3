"""What makes runs and analyses in tests short."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tolevo.algorithms.exact import bounds as between
from tolevo.commands.gap import page


@pytest.fixture(scope="module", autouse=True)
def few_points_are_solved() -> Iterator[None]:
    """The bounds of other points come from their neighbours' prices: as valid, but less tight."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(between, "SOLVED", 4)
        yield


@pytest.fixture(scope="module")
def without_figures() -> Iterator[None]:
    """A gap analysis draws no figures, which take most of the time of a short one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "drawings", lambda result: ())
        yield
