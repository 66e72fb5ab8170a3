from dataclasses import fields
from pathlib import Path

import pytest

from tolevo.commands.reproduce.claims import RELATIONS, ClaimTask, Word, check
from tolevo.commands.reproduce.configuration import read_claims
from tolevo.commands.reproduce.recipes import STATISTICS
from tolevo.commands.study.designs import DESIGNS
from tolevo.models.inputs import DISTRIBUTIONS
from tolevo.models.rv_reducer.contact import declared as contact
from tolevo.models.serial_arm.arm import ERRORS, OF_ALLOCATIONS
from tolevo.problems.robot.problem import FIXED_OUTPUTS

DOCS = Path(__file__).resolve().parent.parent / "docs"


@pytest.mark.source_tree
@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_every_distribution_is_documented_with_its_parameters(name: str) -> None:
    text = (DOCS / "inputs.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"| `{name}`"))
    if name == "truncated_normal":
        assert "as `normal`" in row
    else:
        parameters = [one.name for one in fields(DISTRIBUTIONS[name])]  # type: ignore[arg-type]
        assert [one for one in parameters if f"`{one}`" not in row] == []


@pytest.mark.source_tree
def test_every_key_of_an_arm_is_documented() -> None:
    text = (DOCS / "serial_arm.md").read_text(encoding="utf-8")
    keys = [*OF_ALLOCATIONS, "cost_factor", "backlash_factor", "te_factor", "near_deg", "turn_deg",
            "joints_deg", "per_edge", "tool_mm", "centre_mm", "side_mm"]  # fmt: skip
    kinds = {f"{kind}_{unit}": f"{kind}_<j>_{unit}" for kind, (unit, _, _) in ERRORS.items()}
    assert [one for one in keys if one not in text and kinds.get(one, one) not in text] == []


@pytest.mark.source_tree
def test_every_output_of_robot_joint_is_documented() -> None:
    text = (DOCS / "robot_joint.md").read_text(encoding="utf-8")
    names = [one.name for one in FIXED_OUTPUTS]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_every_parameter_of_the_contact_is_documented() -> None:
    text = (DOCS / "contact.md").read_text(encoding="utf-8")
    assert [one.name for one in contact.PARAMETERS if f"`{one.name}`" not in text] == []


@pytest.mark.source_tree
@pytest.mark.parametrize("kind", DESIGNS)
def test_every_design_is_documented_with_its_keys(kind: str) -> None:
    text = (DOCS / "study.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"| `{kind}` | "))
    keys = [one.name for one in fields(DESIGNS[kind])]  # type: ignore[arg-type]
    assert [one for one in keys if f"`{one}`" not in row] == []


@pytest.mark.source_tree
def test_every_relation_statistic_and_verdict_is_documented() -> None:
    text = (DOCS / "reproduce.md").read_text(encoding="utf-8")
    names = [*RELATIONS, *STATISTICS, *map(str, Word)]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_example_of_a_claims_file_runs() -> None:
    (source,) = read_claims([DOCS / "examples" / "my_paper.toml"]).sources
    found = [
        check(ClaimTask(one.id, 0, at, one, source.file.seed)).verdict.word for at, one in enumerate(source.file.claims)
    ]
    assert found == [
        Word.REPRODUCED, Word.REPRODUCED, Word.UNDER_READING, Word.CANNOT_BE_CHECKED,
    ]  # fmt: skip
