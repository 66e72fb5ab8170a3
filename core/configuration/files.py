"""Tables with the contents of the files that they name: costs, measured parts."""

from __future__ import annotations

import copy
from pathlib import Path

from ..errors import Fault
from .cost_files import fill_costs
from .cost_rows import Filled, Raw
from .measured_files import fill_measured


def with_files(table: Raw, folder: Path, faults: list[Fault]) -> Filled:
    """The tables of a run with the contents of their files, as seen from `folder`; faults are added
    to `faults`.
    """
    filled = Filled(copy.deepcopy(table))
    fill_measured(filled.table, folder, faults)
    fill_costs(filled, folder, faults)
    return filled
