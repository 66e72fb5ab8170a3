"""Links and reducers of serial arms: the figures of the note, sections 3 to 6, and by other ways.

Machine: KUKA KR 5 arc, cube of 400 mm, tool down; RV-40E in joints 1 to 3, the wrist at half the
cost with 1.5 times backlash and transmission error. Costs: `rv_backlash` as printed, document B's
modification without stagger, Q = 5. The note has 25 errors of links (beta only where the next axis
is parallel), none once calibrated.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from tolevo.algorithms.exact.bounds import proof, restrict_form
from tolevo.algorithms.exact.choices import least_cost, search_vectors
from tolevo.algorithms.exact.solver import Exact, exact_vectors
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.serial_arm.kinematics import Chain, positions, singular_joints
from tolevo.problems.serial_arm import SerialArmAllocation
from tolevo.problems.serial_arm.definition import Definition, shipped_arm
from tolevo.problems.settings import PropagationSetting, Settings
from tolevo.section import Value
from tolevo.testing import ProblemContract

PARALLEL = 2
"""The joint of the KR 5 arc whose next axis is parallel."""
C = {"as built": 2.24, "calibrated": 2.33, "held": 2.55}
"""A/R of the note."""


@lru_cache(maxsize=16)
def arm(groups: str = "", held: tuple[int, ...] = (), tool: tuple[float, ...] = ()) -> Definition:
    """The arm of the note: drives in groups of a letter each, flanks of some joints held."""
    whole = shipped_arm()
    joints = []
    for at, one in enumerate(whole.joints, 1):
        assert one.gearing is not None
        flank, group = "held" if at in held else "", groups[at - 1 : at]
        errors = () if at == PARALLEL else (("beta", None),)
        joints.append(replace(one, gearing=replace(one.gearing, flank=flank, group=group),
                              errors=errors))  # fmt: skip
    table = dict(whole.table) | {f"nominal_tool_{axis}_mm": value
                                 for axis, value in zip("xyz", tool, strict=False)}  # fmt: skip
    return replace(whole, table=table, joints=tuple(joints))


def problem_of(definition: Definition | None = None, **parameters: Value) -> SerialArmAllocation:
    return SerialArmAllocation(
        Settings(
            parameters={"flanks": "free", **parameters},
            definition=definition or arm(),
            objectives=("cost", "pose_accuracy_mm"),
            propagation=PropagationSetting(samples=30_000),
        )
    )


def optimum(problem: SerialArmAllocation, rms: float) -> tuple[np.ndarray, dict[str, float], float]:
    """Design, outputs and bound of the least cost at a rms position error [mm]."""
    form = problem.form()
    assert form is not None
    found = least_cost(restrict_form(form, np.arange(len(form.outputs)) < 1), np.array([[rms]]))
    design = problem.complete(search_vectors(problem, form, found))
    values = problem.first_order(design)
    return design, {name: float(one[0]) for name, one in values.items()}, float(found.bound[0])


def rms_of(problem: SerialArmAllocation, design: np.ndarray) -> np.ndarray:
    """Rms backlash of the joints [arcmin]."""
    square = problem.gears.at(problem._of_gears(design)).square[0, list(problem.gears.gear_of)]
    return np.asarray(np.sqrt(square) * problem.gears.factors)


@pytest.mark.source_tree
@pytest.mark.slow
def test_a_loose_limit_on_the_accuracy_is_used_up() -> None:
    """Six moves of the rms ended 3e-7 outside of 0.8 mm, and the tightest tolerances were told, at 914.7.

    The front of the same arm has the points on either side of the limit.
    """
    path = Path(__file__).parents[2] / "configs" / "robot_arm_ur5.toml"
    problem = read(path, overrides=['objectives.minimise=["cost"]', "limits.pose_accuracy_mm=0.8"]).problem
    whole = read(path).problem
    assert problem is not None and whole is not None
    found = problem.outputs_of(problem.complete(search(problem, Exact(), Budget(), 1).chosen))
    assert 0.8 * (1.0 - 1e-4) < found["pose_accuracy_mm"][0] <= 0.8
    f = whole.tested(search(whole, Exact(points=12), Budget(), 1).chosen)[0]
    f = f[np.argsort(f[:, 1])]
    along = np.interp([0.8 * 0.8, 0.8 * 1.2], f[:, 1], f[:, 0])
    assert along[1] < found["cost"][0] < along[0]


class TestContract(ProblemContract):
    problem_type = SerialArmAllocation
    shared = SerialArmAllocation(Settings(propagation=PropagationSetting(samples=1024)))

    def problem(self) -> SerialArmAllocation:
        return self.shared

    def test_five_errors_a_joint_and_two_numbers_a_reducer(self) -> None:
        names = self.shared.names
        assert len(names) == 30 + 12
        assert names[:6] == ["zero_1_mrad", "d_1_um", "a_1_um", "alpha_1_mrad", "beta_1_mrad",
                             "zero_2_mrad"]  # fmt: skip


class TestMaps:
    """Section 5 of the note."""

    def test_mm_per_arcmin(self) -> None:
        found = np.sqrt(problem_of().machine.squares["backlash"])
        wanted = [0.2540, 0.2243, 0.1949, 0.0294, 0.0335, 0.0]
        np.testing.assert_allclose(found, wanted, atol=5e-5)
        assert np.sqrt(np.sum(found[:3] ** 2)) / 2.0 == pytest.approx(0.195, abs=5e-4)

    def test_of_a_tool(self) -> None:
        """150 mm aside and 100 mm ahead of the flange, which stays where it was."""
        found = np.sqrt(problem_of(arm(tool=(150.0, 0.0, 100.0))).machine.squares["backlash"])
        wanted = [0.2966, 0.2550, 0.2454, 0.0399, 0.0759, 0.0436]
        np.testing.assert_allclose(found, wanted, atol=6e-5)

    def test_lengths_and_zeros(self) -> None:
        problem = problem_of()
        square = dict(zip(problem.link_names, problem.machine.links[0], strict=True))
        lengths = [one for name, one in square.items() if name[:2] in ("d_", "a_")]
        assert len(lengths) == 12
        assert 20.0 * np.sqrt(sum(lengths)) == pytest.approx(0.0693, abs=5e-5)
        zeros = [one for name, one in square.items() if name.startswith("zero")]
        assert 0.05 * np.sqrt(sum(zeros)) == pytest.approx(0.0676, abs=5e-5)

    def test_multi_directional_variation(self) -> None:
        """1', the wrist 1.5': 0.22 to 0.30 mm, any approach 0.45 to 0.55; the orientation kept."""
        machine = problem_of().machine
        play = np.array([1.0, 1.0, 1.0, 1.5, 1.5, 1.5])
        assert 0.22 < machine.variation(play[None, :])[0] < 0.30
        many = np.random.default_rng(1).normal(size=(60, 3))
        each = machine.places.drives.variation(play * np.pi / 10800.0, many)
        assert 0.45 < 1e3 * np.sqrt(np.mean(each)) < 0.55


class TestGravity:
    def test_torques_change_sign_where_the_note_says(self) -> None:
        """Joint 3 one sign, joint 2 with 5 kg -282 to -14 N m, empty -238 to +8.5."""
        torque = {load: problem_of(payload_kg=load).machine.places.torque for load in (0.0, 5.0)}
        ends = [torque[5.0][:, 1].min(), torque[5.0][:, 1].max(), torque[0.0][:, 1].min(),
                torque[0.0][:, 1].max()]  # fmt: skip
        assert ends == pytest.approx([-282.0, -14.5, -238.3, 8.5], abs=0.2)
        assert np.all(torque[0.0][:, 2] < 0.0) and np.all(torque[5.0][:, 2] < 0.0)

    def test_joints_1_4_and_6_are_never_held(self) -> None:
        machine = problem_of(flanks="gravity").machine
        free = machine.free(machine.places)
        assert np.all(free[:, [0, 3, 5]] == 1.0)
        assert np.all(free[:, 1:3] == 0.0)

    def test_wind_up(self) -> None:
        """5 kg 0.117 (0.166) mm; with the own weight 0.525 (0.834), 0.222 varying over the cell."""
        whole = problem_of().machine
        assert whole.wind_up == pytest.approx(0.525, abs=1e-3)
        assert np.linalg.norm(whole.wound_up, axis=1).max() == pytest.approx(0.834, abs=5e-4)
        assert whole.wind_up_varying == pytest.approx(0.222, abs=5e-4)
        bare = arm()
        light = replace(bare, joints=tuple(replace(one, mass=0.0) for one in bare.joints))
        only = problem_of(light).machine
        assert only.wind_up == pytest.approx(0.117, abs=1e-3)
        assert np.linalg.norm(only.wound_up, axis=1).max() == pytest.approx(0.166, abs=5e-4)


class TestLeastCosts:
    """Section 4: costs at A = 0.15 mm by the note's c, which it gives with three digits: 0.3 %."""

    def test_at_a_rms_of_80_um(self) -> None:
        """97.620499; ours is 0.07 % lower, as test_robot_least_cost finds by itself."""
        problem = problem_of(calibrated="position")
        _, found, bound = optimum(problem, 0.08)
        assert found["cost_reducers"] == pytest.approx(97.620499, rel=1e-3)
        assert found["cost"] - bound == pytest.approx(0.0, abs=1e-5 * found["cost"])
        assert found["cost"] >= bound

    def test_as_built(self) -> None:
        problem = problem_of()
        design, found, _ = optimum(problem, 0.15 / C["as built"])
        assert found["cost_links"] == pytest.approx(69.9, rel=3e-3)
        assert found["cost_reducers"] == pytest.approx(145.7, rel=3e-3)
        wanted = [0.25, 0.26, 0.27, 0.59, 0.56]
        np.testing.assert_allclose(rms_of(problem, design)[:5], wanted, atol=6e-3)
        alike = optimum(problem_of(replace(arm(), per_drive=False)), 0.15 / C["as built"])[1]
        assert alike["cost"] == pytest.approx(243.4, rel=3e-3)
        assert 1.0 - found["cost"] / alike["cost"] == pytest.approx(0.114, abs=1e-3)

    @pytest.mark.parametrize(
        ("case", "held", "cost", "alike", "in_two", "rms"),
        [("calibrated", (), 127.8, 151.6, 133.5, (0.27, 0.27, 0.28, 0.66, 0.62)),
         ("held", (2, 3, 5), 77.5, 120.6, 105.9, (0.29, None, None, 0.89, None))],
    )  # fmt: skip
    def test_calibrated(
        self, case: str, held: tuple[int, ...], cost: float, alike: float, in_two: float, rms: tuple[float | None, ...]
    ) -> None:
        """With reducers equal everywhere, and equal in joints 1 to 3 and 4 to 6."""
        own = arm(held=held)
        found, made = [], np.empty(0)
        for one in (own, replace(own, per_drive=False), arm("aaabbb", held)):
            problem = problem_of(one, calibrated="position")
            design, values, _ = optimum(problem, 0.15 / C[case])
            found.append(values["cost_reducers"])
            if one is own:
                made = rms_of(problem, design)
        assert found == pytest.approx([cost, alike, in_two], rel=3e-3)
        for at, wanted in enumerate(rms):
            if wanted is not None:
                assert made[at] == pytest.approx(wanted, abs=6e-3)
        for at in held:
            assert made[at - 1] == pytest.approx(
                problem_of(own).gears.nested[0].range[1] * problem_of(own).gears.factors[at - 1]
            )

    def test_next_unit_of_money(self) -> None:
        """Documents' gears, reference links: grade of gear 1 20.5 um, 2 16.0, bearing 1 12.4, zero
        1 10.1; held, gear 1's grade 36.4, bearing 22.0.
        """
        found = []
        for held, calibrated in (((), "none"), ((2, 3, 5), "position")):
            own = replace(arm(held=held), nested=False)
            problem = problem_of(own, nested=False, calibrated=calibrated)
            design = next(iter(problem.references().values()))[None, :]
            rms = problem.first_order(design)["pose_rms_mm"]
            found.append({name: float(one[0]) for name, one in problem._prices(design, rms).items()})
        assert found[0]["price_reducer_1_involute_grade"] == pytest.approx(20.5, rel=0.04)
        assert found[0]["price_reducer_2_involute_grade"] == pytest.approx(16.0, rel=0.04)
        assert found[0]["price_reducer_1_crank_bearing_um"] == pytest.approx(12.4, rel=0.04)
        assert found[0]["price_zero_1_mrad"] == pytest.approx(10.1, rel=0.04)
        assert found[1]["price_reducer_1_involute_grade"] == pytest.approx(36.4, rel=0.04)
        assert found[1]["price_reducer_1_crank_bearing_um"] == pytest.approx(22.0, rel=0.04)


class TestMonteCarloOfTheExactChain:
    @pytest.mark.parametrize(("calibrated", "c"), [("none", 2.2), ("position", 2.33)])
    def test_rms_and_accuracy(self, calibrated: str, c: float) -> None:
        """Units by the exact forward kinematics: R within 1 %, A within 2 %."""
        problem = problem_of(calibrated=calibrated)
        design, _, _ = optimum(problem, 0.08)
        n, rng = 60_000, np.random.default_rng(7)
        machine, gears = problem.machine, problem.gears
        pose = np.arange(n) % len(machine.reached.angles)
        angles = machine.reached.angles[pose].copy()
        square = gears.built(problem._of_gears(design))[0]
        play, _, roots = gears.units(square, rng.uniform(size=(n, gears.dimensions)))
        for joint in range(6):
            waves, phase = rng.normal(size=(n, 2)) @ roots[joint].T, rng.uniform(0, 2 * np.pi, n)
            te = waves[:, 0] * np.cos(phase) + waves[:, 1] * np.sin(phase)
            side = rng.choice([-1.0, 1.0], n)
            angles[:, joint] += (0.5 * side * play[:, joint] + te) * np.pi / 10800.0
        nominal = machine.chain
        wanted = positions(nominal, machine.reached.angles)[pose]
        if calibrated == "none":
            reached = np.empty((n, 3))
            for rows in np.array_split(rng.permutation(n), 3000):
                reached[rows] = positions(made(nominal, problem, design[0], rng), angles[rows])
        else:
            reached = positions(nominal, angles)
        found = 1e3 * np.linalg.norm(reached - wanted, axis=1)
        reported = problem._by_monte_carlo(design, np.array([0.08]))["pose_accuracy_mm"][0]
        assert np.sqrt(np.mean(found**2)) == pytest.approx(0.08, rel=1e-2)
        assert np.quantile(found, 0.9973) == pytest.approx(reported, rel=2e-2)
        assert reported / 0.08 == pytest.approx(c, rel=2e-2)


def made(nominal: Chain, problem: SerialArmAllocation, design: np.ndarray, rng: np.random.Generator) -> Chain:
    """A unit of the chain with errors drawn to a design."""
    parts = {name: getattr(nominal, name).copy() for name in ("zero", "d", "a", "alpha", "beta")}
    for name, sigma in zip(problem.link_names, design, strict=False):
        kind, joint, unit = name.rsplit("_", 2)
        parts[kind][int(joint) - 1] += sigma * (1e-6 if unit == "um" else 1e-3) * rng.normal()
    return replace(nominal, **parts)


class TestEveryToleranceOfSixReducers:
    def test_all_variables_are_as_cheap_and_proven(self) -> None:
        """All variables, 15,625 choices of grades: as cheap as nested, proven over all of them."""
        whole = problem_of(replace(arm(), nested=False), nested=False)
        assert whole.n_var == 25 + 6 * 23
        form = whole.form()
        assert form is not None
        designs = whole.complete(exact_vectors(whole, form, 4))
        found = whole._outputs(designs, searching=True)
        gap = proof(whole, found, len(designs)).gap_percent(found["cost"])
        assert np.all(gap >= 0.0) and np.max(gap) <= 1e-3
        small = optimum(problem_of(), float(found["pose_rms_mm"][1]))[1]
        assert small["cost"] == pytest.approx(found["cost"][1], rel=1e-6)

    def test_no_random_design_beats_its_bound(self) -> None:
        whole = problem_of(replace(arm(), nested=False), nested=False)
        share = np.random.default_rng(5).uniform(size=(12, whole.n_var)) ** 2
        designs = whole.complete(whole.xl * (whole.xu / whole.xl) ** share)
        found = whole._outputs(designs, searching=True)
        assert np.all(proof(whole, found, len(designs)).bound <= found["cost"] * (1.0 + 1e-9))

    def test_shares_make_the_whole(self) -> None:
        found = optimum(problem_of(), 0.08)[1]
        shares = [one for name, one in found.items() if name.startswith("share_")]
        assert len(shares) == 31
        assert sum(shares) == pytest.approx(100.0, rel=1e-12)


class TestLeastError:
    def test_what_has_no_effect_costs_nothing(self) -> None:
        """Joint 6 turns about the flange: by inverse kinematics 1e-18 mm, which is no effect."""
        cell = replace(arm().cell, listed=((0.3, 0.0, 0.6), (0.4, 0.1, 0.5)))
        machine = problem_of(replace(arm(), cell=cell)).machine
        assert machine.squares["wave"][5] == 0.0
        assert np.all(machine.squares["wave"][:5] > 0.0)


class TestFewJoints:
    def test_an_arm_of_two_joints_and_a_direct_drive(self) -> None:
        """Calibrated, commands of a short chain correct its position alone: orientation stays."""
        whole = shipped_arm()
        table = {"nominal_d_1_mm": 300.0, "nominal_a_1_mm": 0.0, "nominal_alpha_1_deg": 90.0,
                 "nominal_d_2_mm": 0.0, "nominal_a_2_mm": 400.0, "nominal_alpha_2_deg": 0.0,
                 "nominal_d_3_mm": 0.0, "nominal_a_3_mm": 300.0, "nominal_alpha_3_deg": 0.0,
                 "nominal_offset_1_deg": 0.0, "nominal_offset_2_deg": 0.0,
                 "nominal_offset_3_deg": 0.0}  # fmt: skip
        joints = (*whole.joints[:2], replace(whole.joints[2], gearing=None))
        cell = replace(whole.cell, centre=(0.4, 0.0, 0.4), side=0.1, per_edge=3,
                       near=(0.0, 0.9, -1.5))  # fmt: skip
        problem = problem_of(Definition(table, joints, cell), calibrated="position")
        assert not problem.faults()
        assert not any(singular_joints(problem.machine.chain, problem.machine.frames))
        assert problem.machine.geared == 2
        assert np.all(problem.machine.links[0] < 1e-20)
        assert problem.machine.links[1].sum() > 0.0
        assert optimum(problem, 0.05)[1]["pose_rms_mm"] == pytest.approx(0.05, rel=1e-9)

    def test_an_arm_of_direct_drives_alone(self) -> None:
        """A joint of 400 mm: its zero turns the tool by 0.4 mm/mrad, d and a move it as much as they are off."""
        table = {"joint": [{"d_mm": 300.0, "a_mm": 400.0, "alpha_deg": 0.0, "offset_deg": 0.0, "reducer": "none",
                            "beta_mrad": "none"}],
                 "problem": "serial_arm", "cell": {"joints_deg": [[30.0]]},
                 "parameters": {"flanks": "held"}}  # fmt: skip
        problem = read(table).problem
        assert problem is not None
        names = {"zero_1_mrad": 0.1, "d_1_um": 20.0, "a_1_um": 30.0, "alpha_1_mrad": 0.2}
        design = np.array([[names[name] for name in problem.names]])
        values = problem.outputs_of(design)
        assert values["pose_rms_mm"][0] == pytest.approx(np.sqrt(0.04**2 + 0.02**2 + 0.03**2), rel=1e-12)
        assert values["backlash_rms_arcmin"][0] == values["te_amplitude_arcsec"][0] == values["cost_reducers"][0] == 0.0
        fixed = {"variables": {name: {"value": value} for name, value in names.items()}}
        alone = read({**table, **fixed}).problem  # its cost is one value for every design, and no fault
        assert alone is not None
        assert not alone.free

    def test_a_joint_that_does_not_move_the_tool_is_told_so(self) -> None:
        joints = [{"d_mm": 0.0, "a_mm": a, "alpha_deg": 0.0, "offset_deg": 0.0, "beta_mrad": "none"}
                  for a in (400.0, 0.0)]  # fmt: skip
        with pytest.raises(InputError, match="is singular: joint 2 does not move the tool; move the cell"):
            read({"problem": "serial_arm", "joint": joints, "cell": {"joints_deg": [[30.0, 2.0]]},
                  "parameters": {"flanks": "held"}})  # fmt: skip
