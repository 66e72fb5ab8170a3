from pathlib import Path

import pytest

from tolevo.commands.reproduce.calculations.reducer import ReducerMonteCarlo, StaggeredAssembly
from tolevo.commands.reproduce.calculations.tooth_modification import ToleranceZones, ToothModificationTargets
from tolevo.commands.reproduce.recipes import Calculation
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.tooth_modification import ToothModification

DOCS = Path(__file__).resolve().parent.parent / "docs"
pytestmark = pytest.mark.source_tree


def test_every_name_of_the_tooth_modification_is_documented() -> None:
    text = (DOCS / "tooth_modification.md").read_text(encoding="utf-8")
    kind = ToothModification.declaration
    names = [one.name for one in kind.variables] + [one.name for one in kind.outputs]
    names += [one.name for one in kind.parameters]
    assert [name for name in names if f"`{name}`" not in text] == []
    for variable in kind.variables:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{variable.name}`"))
        assert f"| {variable.low:g} .. {variable.high:g} |" in row


def test_every_name_of_the_exact_contact_is_documented() -> None:
    text = (DOCS / "rv_reducer.md").read_text(encoding="utf-8")
    kind = RvReducer.declaration
    names = [variable.name for variable in kind.variables]
    names += [output.name for output in kind.outputs] + [one.name for one in kind.parameters]
    assert [name for name in names if f"`{name}`" not in text] == []
    rows = text.partition("## Variables")[2].splitlines()
    for variable in kind.variables:
        row = next(line for line in rows if line.startswith(f"| `{variable.name}` |"))
        assert f"| {variable.low:g} .. {variable.high:g} |" in row


def test_assumed_parameters_of_the_exact_contact_are_marked() -> None:
    text = (DOCS / "rv_reducer.md").read_text(encoding="utf-8").partition("## Parameters")[2]
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    for one in RvReducer.declaration.parameters:
        row = next(line for line in rows if f"`{one.name}`" in line)
        assert not one.assumed or "assumed" in row, one.name


@pytest.mark.parametrize("kind", [ToothModificationTargets, ToleranceZones, ReducerMonteCarlo, StaggeredAssembly])
def test_every_quantity_of_the_reducer_is_documented(kind: type[Calculation]) -> None:
    text = (DOCS / "rv40e_document.md").read_text(encoding="utf-8")
    assert f"| `{kind.name}` |" in text
    for one in kind.outputs:
        stem = one.name.removeprefix("clipped_").removeprefix("without_")
        assert f"`{one.name}`" in text or f"`{stem}`" in text, one.name
