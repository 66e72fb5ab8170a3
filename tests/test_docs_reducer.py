from pathlib import Path

import pytest

from tolevo.problems.tooth_modification import ToothModification
from tolevo.workflows.reproduce.calculation import Calculation
from tolevo.workflows.reproduce.calculations.reducer_monte_carlo import ReducerMonteCarlo
from tolevo.workflows.reproduce.calculations.staggered_assembly import StaggeredAssembly
from tolevo.workflows.reproduce.calculations.tolerance_zones import ToleranceZones
from tolevo.workflows.reproduce.calculations.tooth_modification import ToothModificationTargets

DOCS = Path(__file__).resolve().parent.parent / "docs"
pytestmark = pytest.mark.source_tree


def test_every_name_of_the_tooth_modification_is_documented() -> None:
    text = (DOCS / "tooth_modification.md").read_text(encoding="utf-8")
    kind = ToothModification
    names = [one.name for one in kind.variables] + [one.name for one in kind.outputs]
    names += [one.name for one in kind.parameters]
    assert [name for name in names if f"`{name}`" not in text] == []
    for variable in kind.variables:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{variable.name}`"))
        assert f"| {variable.low:g} .. {variable.high:g} |" in row


@pytest.mark.parametrize(
    "kind", [ToothModificationTargets, ToleranceZones, ReducerMonteCarlo, StaggeredAssembly]
)
def test_every_quantity_of_the_reducer_is_documented(kind: type[Calculation]) -> None:
    text = (DOCS / "rv40e_document.md").read_text(encoding="utf-8")
    assert f"| `{kind.name}` |" in text
    for one in kind.outputs:
        stem = one.name.removeprefix("clipped_").removeprefix("without_")
        assert f"`{one.name}`" in text or f"`{stem}`" in text, one.name
