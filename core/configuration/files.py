"""Tables with the contents of the files that they name: costs, measured parts."""

from __future__ import annotations

from pathlib import Path

from ..errors import Fault
from .cost_files import Filled, Raw, with_cost_files
from .measured_files import with_measured_files


def with_files(table: Raw, folder: Path, faults: list[Fault]) -> Filled:
    """The tables of a run with what stands in their files, as seen from `folder`; faults are added
    to `faults`.
    """
    return with_cost_files(with_measured_files(table, folder, faults), folder, faults)
