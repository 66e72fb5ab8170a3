"""What holds for all tests."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pandas as pd
import pytest

from tolevo.options import Into

if pd.__version__.startswith(("2.", "3.0")):  # whose default loses the last digit of some numbers
    pd.read_csv = partial(pd.read_csv, float_precision="round_trip")  # type: ignore[assignment]


@pytest.fixture(scope="session", autouse=True)
def one_process() -> Iterator[None]:
    """Commands that are not told `--workers` compute in the process of the test.

    No result depends on it. Each further process would import everything anew, which takes longer
    than the work of most tests, and the tests themselves run on all cores already.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Into.arguments, "__defaults__", (1,))
        yield
