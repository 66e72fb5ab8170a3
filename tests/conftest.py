"""What holds for all tests."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pandas as pd
import pytest

from tolevo.cli import Into
from tolevo.files import exact_reading

if options := exact_reading():  # tests read tables as tolevo does
    pd.read_csv = partial(pd.read_csv, **options)  # type: ignore[assignment]


@pytest.fixture(scope="session", autouse=True)
def one_process() -> Iterator[None]:
    """Commands that are not told `--workers` compute in the process of the test.

    No result depends on it. Each further process would import everything anew, which takes longer
    than the work of most tests, and the tests themselves run on all cores already.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Into.arguments, "__defaults__", (1,))
        yield


@pytest.fixture(scope="module")
def unrendered() -> Iterator[None]:
    """Figures are made, and written as blanks: to render them takes most of a short run or study.

    For tests of what is computed, kept and resumed; those of tests/page render every figure.
    """
    from tests.blanks import blanks

    with blanks():
        yield


@pytest.fixture(scope="module")
def units_once() -> Iterator[None]:
    """Models of the same loaded unit share its tables, which take a third of a second each."""
    from tests.same_units import made_once

    with made_once():
        yield
