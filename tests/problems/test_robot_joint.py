"""The whole machine: links and reducers of the manipulator, against the note and by other ways.

Costs are those of `rv_backlash` as printed, document B's modification without stagger, Q = 5.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact.bounds import proof, restrict_form
from tolevo.algorithms.exact.choices import least_cost, search_vectors
from tolevo.algorithms.exact.combination import Combination, Optimum
from tolevo.algorithms.exact.programme import Programme
from tolevo.algorithms.exact.solver import closed_form, exact_vectors
from tolevo.algorithms.nsga3 import NSGA3
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.models.manipulator.forward import exact_pose
from tolevo.models.manipulator.maps import NAMES, SCALES
from tolevo.problems.nested_reducers import Nested, documents_reducer
from tolevo.problems.robot_joint import TWENTY_ONE, Definition, RobotJoint
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.testing import ProblemContract

FOUR = ("cost", "pose_accuracy_mm", "squareness_mrad", "yaw_mrad")

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


def machine(objectives: tuple[str, ...] = FOUR, **parameters: object) -> RobotJoint:
    given = {"flanks": "free", **parameters}
    return RobotJoint(Settings(parameters=given, objectives=objectives))  # type: ignore[arg-type]


@lru_cache(maxsize=32)
def optimum(
    rms: float,
    calibrated: str = "none",
    flanks: str = "free",
    hysteresis: float = 0.0,
    nested: bool = True,
    price: float = 1.0,
) -> tuple[RobotJoint, np.ndarray, float]:
    """Least cost at a rms position error [mm], squareness and yaw 0.2 mrad."""
    problem = machine(calibrated=calibrated, flanks=flanks, hysteresis_arcmin=hysteresis,
                      nested=nested, reducer_price=price)  # fmt: skip
    found = at_limits(problem, [rms, 0.2, 0.2])
    form = problem.form()
    assert form is not None
    design = problem.complete(search_vectors(problem, form, found))[0]
    return problem, design, float(found.bound[0])


def at_limits(problem: RobotJoint, limits: list[float]) -> Optimum:
    form = problem.form()
    assert form is not None
    used = np.arange(len(form.outputs)) < 3
    return least_cost(restrict_form(form, used), np.array([limits]))


def outputs(problem: RobotJoint, design: np.ndarray, *names: str) -> list[float]:
    found = problem.first_order(design[None, :])
    return [float(found[name][0]) for name in names]


class TestContract(ProblemContract):
    problem_type = RobotJoint
    shared = RobotJoint(Settings(propagation=PropagationSetting(samples=2048)))

    def problem(self) -> RobotJoint:
        return self.shared


class TestEveryToleranceContract(ProblemContract):
    problem_type = RobotJoint
    shared = RobotJoint(Settings(parameters={"nested": False, "flanks": "free"},
                                 propagation=PropagationSetting(samples=2048)))  # fmt: skip

    def problem(self) -> RobotJoint:
        return self.shared


class TestErrorsAsBuilt:
    """Section 3 of the note: who dominates."""

    def test_backlash_of_an_arcmin_in_both_joints(self) -> None:
        mean = machine().machine.squares
        assert np.sqrt(mean["backlash"].sum() / 4.0) == pytest.approx(0.0714, abs=5e-5)

    @pytest.mark.parametrize(("sigma", "wanted"), [(10.0, 0.0352), (20.0, 0.0705), (50.0, 0.1762)])
    def test_lengths(self, sigma: float, wanted: float) -> None:
        lengths = ("origin", "arm_length", "rod_length", "attachment")
        own = [name.startswith(lengths) for name in TWENTY_ONE]
        assert sum(len(each) for name, each in TWENTY_ONE.items() if name.startswith(lengths)) == 27
        found = sigma * np.sqrt(machine().machine.links[0][own].sum())
        assert found == pytest.approx(wanted, abs=6e-5)

    def test_arm_orientations(self) -> None:
        own = [name.startswith("arm_orientation") for name in TWENTY_ONE]
        found = 0.1 * np.sqrt(machine().machine.links[0][own].sum())
        assert found == pytest.approx(0.0624, abs=5e-5)

    def test_documents_reducers(self) -> None:
        """rms b 0.742', TE rms 0.119', 0.0556 mm; of that 91 % backlash once calibrated."""
        problem = machine(nested=False, calibrated="position")
        design = next(iter(problem.references().values()))
        found = problem.first_order(design[None, :])
        te = problem.gears.at(problem._of_gears(design[None, :])).wave[0]
        np.testing.assert_allclose(te, 0.119, atol=5e-4)
        assert found["pose_rms_mm"][0] == pytest.approx(0.0556, abs=1e-4)
        share = 0.25 * found["reversal_mm"][0] ** 2 / found["pose_rms_mm"][0] ** 2
        assert 100.0 * share == pytest.approx(91.0, abs=0.6)

    def test_wind_up_is_an_output(self) -> None:
        assert machine().machine.wind_up == pytest.approx(0.0298, abs=5e-5)

    def test_gravity_holds_the_flanks_of_a_payload(self) -> None:
        """From 9.4 kg on at every pose, at 6.0 kg at half of them."""
        held = {payload: machine(flanks="gravity", payload_kg=payload).machine.held_percent
                for payload in (0.0, 6.0, 9.5)}  # fmt: skip
        assert held[0.0] == pytest.approx(0.0, abs=1e-9)
        assert held[9.5] == pytest.approx(100.0)
        assert 30.0 < held[6.0] < 70.0


class TestLeastCosts:
    """Sections 4 and 6 of the note. Least costs are up to 0.04 % below the note's; why ours
    stand is in test_robot_least_cost."""

    @pytest.mark.parametrize(
        ("calibrated", "cost"), [("none", 75.524343), ("position", 55.982930)]
    )  # fmt: skip
    def test_at_a_rms_of_50_um(self, calibrated: str, cost: float) -> None:
        problem, design, bound = optimum(0.05, calibrated)
        found = outputs(problem, design, "cost")[0]
        assert found == pytest.approx(cost, rel=5e-4)
        assert bound <= found and found - bound <= 1e-5 * found

    def test_as_built_at_150_um(self) -> None:
        problem, design, _ = optimum(0.0597)
        names = ("cost", "cost_links", "cost_reducers", "backlash_rms_arcmin", "squareness_mrad")
        found = outputs(problem, design, *names)
        assert found == pytest.approx([66.13, 33.23, 32.90, 0.516, 0.2], rel=8e-4)
        grade = problem.gears.nested[0].grades[problem.gears.nested[0].grade_at(design[[21]])]
        assert list(grade) == [5.0]

    def test_calibrated_at_150_um(self) -> None:
        problem, design, _ = optimum(0.0579, "position")
        names = ("cost", "cost_links", "cost_reducers", "backlash_rms_arcmin")
        found = outputs(problem, design, *names)
        assert found == pytest.approx([52.62, 25.43, 27.19, 0.627], rel=8e-4)

    def test_calibrated_with_held_flanks(self) -> None:
        """Backlash does not count: it goes to its bound."""
        problem, design, _ = optimum(0.0579, "position", "held")
        assert outputs(problem, design, "cost")[0] == pytest.approx(41.79, rel=5e-4)
        assert design[21] == pytest.approx(problem.xu[21])

    @pytest.mark.parametrize(("calibrated", "without", "with_it"), [("none", 66.9, 79.4), ("position", 52.3, 59.4)])
    def test_hysteresis_counts(self, calibrated: str, without: float, with_it: float) -> None:
        """0.27' at +-3 % torque raises the cost of A = 0.15 mm, with c = 2.55."""
        costs = []
        for lost in (0.0, 0.27):
            problem, design, _ = optimum(0.15 / 2.55, calibrated, "free", lost)
            costs += outputs(problem, design, "cost")
        assert costs == pytest.approx([without, with_it], rel=1e-3)

    def test_unequal_reducers_cost_more(self) -> None:
        """By symmetry equal ones are the optimum, though two grades are nearly as good."""
        problem, design, _ = optimum(0.05)
        assert design[21] == pytest.approx(design[23], rel=1e-6)
        form = problem.form()
        assert form is not None
        unequal = restrict_form(form, np.arange(len(form.outputs)) < 3)
        first, second = unequal.features[0].ways[0], unequal.features[1].ways[1]
        features = list(unequal.features)
        features[0] = replace(features[0], ways=(first,))
        features[1] = replace(features[1], ways=(second,))
        found = least_cost(replace(unequal, features=tuple(features)), np.array([[0.05, 0.2, 0.2]]))
        assert found.cost[0] == pytest.approx(76.09, rel=2e-3)
        assert found.cost[0] > outputs(problem, design, "cost")[0]

    def test_margins_are_equal_at_the_optimum(self) -> None:
        """1.17 cost per um of R as built at 0.05 mm, 0.52 calibrated."""
        for calibrated, wanted in (("none", 1.17), ("position", 0.52)):
            problem, design, _ = optimum(0.05, calibrated)
            costs = [at_limits(problem, [rms, 0.2, 0.2]).cost[0] for rms in (0.04995, 0.05005)]
            assert 10.0 * (costs[0] - costs[1]) == pytest.approx(wanted, rel=1e-2)
        problem, design, _ = optimum(0.05)  # the yaw does not bind: R alone is what they buy
        price = problem._prices(design[None, :], np.array([0.05]))
        for name in ("reducer_1_backlash_rms_arcmin", "reducer_2_te_rms_arcsec", "origin_1_um"):
            assert 1.0 / float(price[f"price_{name}"][0]) == pytest.approx(1.17, rel=1e-2)

    @pytest.mark.parametrize(("price", "share"), [(0.3, 41.0), (1.0, 57.0), (3.0, 71.0)])
    def test_share_of_the_gears_grows_with_their_price(self, price: float, share: float) -> None:
        problem, design, _ = optimum(0.05, price=price)
        names = ("share_joint_1_percent", "share_joint_2_percent")
        assert sum(outputs(problem, design, *names)) == pytest.approx(share, abs=1.5)

    def test_shares_make_the_whole(self) -> None:
        problem, design, _ = optimum(0.05)
        found = problem.first_order(design[None, :])
        shares = [float(each[0]) for name, each in found.items() if name.startswith("share_")]
        assert len(shares) == 23
        assert sum(shares) == pytest.approx(100.0, rel=1e-12)


class TestNextUnitOfMoney:
    """Section 4: documents' gears, reference links; um of R per unit of cost."""

    def prices(self, calibrated: str) -> dict[str, float]:
        problem = machine(nested=False, calibrated=calibrated)
        design = next(iter(problem.references().values()))[None, :]
        rms = problem.first_order(design)["pose_rms_mm"]
        return {name: float(each[0]) for name, each in problem._prices(design, rms).items()}

    def test_as_built(self) -> None:
        found = self.prices("none")
        assert found["price_arm_orientation_1_mrad"] == pytest.approx(16.6, abs=0.3)
        assert found["price_arm_orientation_3_mrad"] == pytest.approx(8.8, abs=0.2)
        assert found["price_reducer_1_involute_grade"] == pytest.approx(6.6, abs=0.4)
        assert found["price_reducer_1_crank_bearing_um"] == pytest.approx(4.0, abs=0.2)
        assert found["price_rod_length_1_um"] == pytest.approx(1.7, abs=0.1)

    def test_calibrated(self) -> None:
        found = self.prices("position")
        assert found["price_reducer_1_involute_grade"] == pytest.approx(11.0, abs=0.6)
        assert found["price_reducer_1_crank_bearing_um"] == pytest.approx(6.7, abs=0.3)
        assert found["price_reducer_1_pin_circle_radius_um"] == pytest.approx(1.4, abs=0.1)
        assert found["price_origin_1_um"] == 0.0


class TestNestedEqualsJoint:
    def test_slsqp_in_every_tolerance(self) -> None:
        """65 variables with the grades given: no cheaper, and as cheap within 1e-6."""
        problem, design, bound = optimum(0.05, nested=False)
        names = [v.name for v in problem.variables]
        whole = np.array([name.endswith("involute_grade") for name in names])
        moving = np.flatnonzero(~whole)
        assert len(moving) == 65
        low, high = (np.log(end[moving]) for end in (problem.xl, problem.xu))

        def at(y: np.ndarray) -> dict[str, np.ndarray]:
            rows = np.repeat(design[None, :], len(np.atleast_2d(y)), axis=0)
            rows[:, moving] = np.exp(np.atleast_2d(y))
            return problem.first_order(rows)

        def slopes(y: np.ndarray, name: str) -> np.ndarray:
            step = 1e-6 * np.eye(len(y))
            found = at(np.vstack([y + step, y - step]))[name]
            return np.asarray((found[: len(y)] - found[len(y) :]) / 2e-6)

        limits = {"pose_rms_mm": 0.05, "squareness_mrad": 0.2, "yaw_mrad": 0.2}
        rules = [
            {"type": "ineq",
             "fun": lambda y, n=n, m=m: 1.0 - float(at(y)[n][0]) / m,
             "jac": lambda y, n=n, m=m: -slopes(y, n) / m}
            for n, m in limits.items()
        ]  # fmt: skip
        start = np.clip(np.log(design[moving]) + 0.3, low, high)
        found = minimize(
            lambda y: float(at(y)["cost"][0]), start, jac=lambda y: slopes(y, "cost"),
            bounds=list(zip(low, high, strict=True)), constraints=rules, method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 400},
        )  # fmt: skip
        nested = outputs(problem, design, "cost")[0]
        assert found.fun == pytest.approx(nested, rel=1e-6)
        assert found.fun >= bound

    def test_every_tolerance_has_the_outputs_of_the_nested_problem(self) -> None:
        small, one, _ = optimum(0.05)
        whole, other, _ = optimum(0.05, nested=False)
        names = ("cost", "pose_rms_mm", "yaw_mrad", "backlash_rms_arcmin", "path_te_mm")
        np.testing.assert_allclose(outputs(small, one, *names), outputs(whole, other, *names), rtol=1e-6)

    def test_prices_of_squares_against_the_programme(self) -> None:
        """Newton's method in the dual and SLSQP in the tolerances, with one way each."""
        problem = machine()
        found = at_limits(problem, [0.04, 0.15, 0.12])
        form = problem.form()
        assert form is not None
        chosen = tuple(found.chosen[0].tolist())
        combination = Combination(restrict_form(form, np.arange(len(form.outputs)) < 3), chosen)
        other = Programme(combination).allocation(np.array([0.04, 0.15, 0.12]))
        assert other is not None
        assert float(combination.cost(other[None, :])[0]) == pytest.approx(found.cost[0], rel=1e-6)

    def test_no_random_design_beats_its_bound(self) -> None:
        problem = machine(nested=False)
        rng = np.random.default_rng(5)
        share = rng.uniform(size=(40, problem.n_var)) ** 2
        designs = problem.complete(problem.xl * (problem.xu / problem.xl) ** share)
        found = problem._outputs(designs, searching=True)
        own = proof(problem, found, len(designs))
        assert np.all(own.bound <= found["cost"] * (1.0 + 1e-9))


class TestFourObjectives:
    @pytest.mark.parametrize("points", [12, pytest.param(64, marks=pytest.mark.slow)])
    def test_gap(self, points: int) -> None:
        problem = machine()
        form = closed_form(problem)
        assert form is not None
        designs = problem.complete(exact_vectors(problem, form, points))
        found = problem._outputs(designs, searching=True)
        assert len(designs) > 0.75 * points
        own = proof(problem, found, len(designs))
        assert np.max(own.gap_percent(found["cost"])) <= 1e-3  # 1e-5 of the cost

    def test_infeasible_points_are_proven_so(self) -> None:
        """A squareness that no tolerances reach, with as much money as you like."""
        found = at_limits(machine(), [0.05, 0.01, 0.2])
        assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])

    def test_genetic_algorithm_stays_above(self) -> None:
        """2000 evaluations; 40,000 end 21 % (nested), 20 % (67 variables) above the surface."""
        problem = machine()
        found = search(problem, NSGA3(population=100), Budget(evaluations=2000), 1)
        designs = problem.complete(found.x[:: max(1, len(found.x) // 20)])
        values = problem._outputs(designs, searching=True)
        gap = proof(problem, values, len(designs)).gap_percent(values["cost"])
        assert np.all(gap > 1.0)


class TestMonteCarloOfTheExactPose:
    """Units by Newton's method: links normal, sides and phases at random, poses over the ring."""

    @pytest.mark.parametrize(
        ("rms", "calibrated", "flanks", "accuracy"),
        [(0.0597, "none", "free", 0.1497), (0.0579, "position", "free", 0.1517),
         (0.05, "none", "held", None)],
    )  # fmt: skip
    def test_rms_and_accuracy(self, rms: float, calibrated: str, flanks: str, accuracy: float | None) -> None:
        """As built, calibrated, and with flanks held, where backlash is a zero of the drive."""
        problem, design, _ = optimum(rms, calibrated, flanks)
        n, rng = 30_000, np.random.default_rng(7)
        r, z = rng.uniform(0.3, 0.65, n), rng.uniform(0.1, 0.3, n)
        errors = np.zeros((n, len(NAMES)))
        if calibrated == "none":
            for at, sources in enumerate(problem.definition.grouping.values()):
                for one in sources:
                    place = NAMES.index(one)
                    errors[:, place] = design[at] * SCALES[place] * rng.normal(size=n)
        nested = problem.gears.nested[0]
        made = nested.designs(design[[21]])
        angles = problem.gears.wave.angles.allocation(design[[22]])
        wave = problem.gears.wave.covariance(angles)[0]
        for drive in (1, 2):
            play = nested.backlashes(made, rng.uniform(size=(n, nested.dimensions)))
            parts, phase = (rng.multivariate_normal(np.zeros(2), wave, n), rng.uniform(0, 2 * np.pi, n))
            te = parts[:, 0] * np.cos(phase) + parts[:, 1] * np.sin(phase)
            side = rng.choice([-1.0, 1.0], n) if flanks == "free" else np.zeros(n)
            arcmin = 0.5 * side * play + te
            errors[:, NAMES.index(f"drive_zero_{drive}_mrad")] = arcmin * np.pi / 10800.0
        found = 1e3 * np.linalg.norm(exact_pose(problem.machine_of(), r, z, 0.0, errors).position, axis=1)
        reported = problem._by_monte_carlo(design[None, :], np.array([rms]))["pose_accuracy_mm"][0]
        assert np.sqrt(np.mean(found**2)) == pytest.approx(rms, rel=1e-2)
        quantile = np.quantile(found, 0.9973)
        assert quantile == pytest.approx(reported, rel=2e-2)
        if accuracy is not None:
            assert reported == pytest.approx(accuracy, rel=2e-2)


class TestReducersOfPoints:
    def test_unproven_and_says_so(self) -> None:
        """A table of prices nests as well; nothing is proven of it."""
        table = Nested("a table", {}, None, ((0.3, 0.5, 0.8, 1.2), (20.0, 12.0, 8.0, 7.0)))
        definition = Definition(TWENTY_ONE, (table, table))
        problem = RobotJoint(Settings(parameters={"flanks": "free"}, definition=definition))
        assert problem.form() is None
        assert "nothing is proven" in " ".join(problem.warnings())
        middle = np.sqrt(problem.xl * problem.xu)[None, :]
        found = problem.outputs_of(problem.complete(middle))
        assert all(np.all(np.isfinite(each)) for each in found.values())

    def test_alike_reducers_share_their_tolerances(self) -> None:
        definition = Definition(TWENTY_ONE, (documents_reducer(),) * 2, per_drive=False)
        settings = Settings(parameters={"flanks": "free", "per_drive": False}, objectives=FOUR,
                            definition=definition)  # fmt: skip
        problem = RobotJoint(settings)
        assert problem.n_var == 23
        found = at_limits(problem, [0.05, 0.2, 0.2])
        assert found.cost[0] == pytest.approx(optimum(0.05)[2], rel=1e-6)


class TestFaults:
    def test_an_objective_that_nothing_changes(self) -> None:
        """Held flanks leave no reversal: said, with what is left."""
        problem = machine(("cost", "reversal_mm"), flanks="held")
        (fault,) = problem.faults()
        assert fault.place == "objectives.minimise[1]"
        assert "held flanks" in fault.message and "residual" in fault.message

    def test_limits_out_of_reach(self) -> None:
        problem = RobotJoint(Settings(parameters={"flanks": "free"},
                                      limits={"pose_rms_mm": Bound(high=1e-4)}))  # fmt: skip
        (fault,) = problem.faults()
        assert fault.place == "limits.pose_rms_mm" and "cannot be met" in fault.message

    def test_a_ring_out_of_reach(self) -> None:
        problem = machine(ring_r_mm=(300.0, 900.0))
        assert any("chain" in fault.message for fault in problem.faults())
