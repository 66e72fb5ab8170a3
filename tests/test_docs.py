from dataclasses import fields
from pathlib import Path

import pytest

from tolevo.commands.reproduce.claims import RELATIONS, ClaimTask, Word, check
from tolevo.commands.reproduce.configuration import read_claims
from tolevo.commands.reproduce.recipes import STATISTICS
from tolevo.commands.study.designs import DESIGNS
from tolevo.models.inputs import DISTRIBUTIONS
from tolevo.models.manipulator.maps import ROWS
from tolevo.models.manipulator.pose import ManipulatorPose
from tolevo.models.rv_reducer.contact import declared as contact
from tolevo.models.rv_reducer.transmission import RvTransmission
from tolevo.models.serial_arm.arm import ERRORS, OF_ALLOCATIONS
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.robot.problem import FIXED_OUTPUTS
from tolevo.problems.robot_joint import PARAMETERS
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.registry import names as names_of

DOCS = Path(__file__).resolve().parent.parent / "docs"


@pytest.mark.source_tree
def test_every_name_of_the_problem_is_documented() -> None:
    text = (DOCS / "rv_backlash.md").read_text(encoding="utf-8")
    names = [one.name for one in RvBacklash.declaration.variables]
    names += [one.name for one in RvBacklash.declaration.outputs]
    names += [one.name for one in RvBacklash.declaration.parameters]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_defaults_in_the_documentation() -> None:
    text = (DOCS / "rv_backlash.md").read_text(encoding="utf-8")
    for variable in RvBacklash.declaration.variables:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{variable.name}`"))
        assert f"| {variable.low:g} .. {variable.high:g} |" in row


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
def test_every_parameter_and_output_of_robot_joint_is_documented() -> None:
    text = (DOCS / "robot_joint.md").read_text(encoding="utf-8")
    names = [one.name for one in PARAMETERS] + [one.name for one in FIXED_OUTPUTS]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_every_parameter_and_error_of_the_manipulator_is_documented() -> None:
    text = (DOCS / "manipulator.md").read_text(encoding="utf-8")
    names = [one.name for one in ManipulatorPose.parameters]
    names += [f"{name}_{unit}" for name, unit, _ in ROWS]
    assert [name for name in names if f"| `{name}` |" not in text] == []


@pytest.mark.source_tree
def test_every_output_and_own_parameter_of_pose_accuracy_is_documented() -> None:
    text = (DOCS / "pose_accuracy.md").read_text(encoding="utf-8")
    shared = {one.name for one in ManipulatorPose.parameters} - {"index"}
    names = [one.name for one in PoseAccuracy.declaration.outputs if not one.error_of]
    names += [one.name for one in PoseAccuracy.declaration.parameters if one.name not in shared]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_every_parameter_and_column_of_rv_transmission_is_documented() -> None:
    text = (DOCS / "transmission_error.md").read_text(encoding="utf-8")
    names = [f"| `{one.name}` |" for one in RvTransmission.parameters]
    names += [f"`{one.name}`" for one in RvTransmission.columns]
    assert [name for name in names if name not in text] == []


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
def test_every_calculation_relation_and_statistic_is_documented() -> None:
    text = (DOCS / "reproduce.md").read_text(encoding="utf-8")
    names = [*names_of("calculations"), *RELATIONS, *STATISTICS, *map(str, Word)]
    assert [name for name in names if f"`{name}`" not in text] == []


@pytest.mark.source_tree
def test_example_of_a_claims_file_runs(tmp_path: Path) -> None:
    text = (DOCS / "reproduce.md").read_text(encoding="utf-8")
    path = tmp_path / "paper.toml"
    block = text.split('```toml title="my_paper.toml"\n')[1].split("```")[0]
    path.write_text(block, encoding="utf-8")
    (source,) = read_claims([path]).sources
    found = [
        check(ClaimTask(one.id, 0, at, one, source.file.seed)).verdict.word for at, one in enumerate(source.file.claims)
    ]
    assert found == [
        Word.REPRODUCED, Word.REPRODUCED, Word.UNDER_READING, Word.CANNOT_BE_CHECKED,
    ]  # fmt: skip
