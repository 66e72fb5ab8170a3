"""The calculations behind the claims, against closed forms and the figures of the notes."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

from tolevo import registry
from tolevo.commands.reproduce.recipes import Calculation, Computed
from tolevo.errors import InputError
from tolevo.models.manipulator.forward import exact_pose
from tolevo.models.manipulator.geometry import Manipulator
from tolevo.models.manipulator.maps import error_vector, orientation_combinations

CHEAP = [name for name in registry.names("calculations") if name != "ga_settings"]


@cache
def computed(name: str, **values: object) -> Computed:
    found = kind(name)().compute(values, np.random.default_rng(1))  # type: ignore[arg-type]
    assert isinstance(found, Computed)
    return found


def kind(name: str) -> type[Calculation]:
    found: type[Calculation] = registry.load("calculations", name)
    return found


def value(name: str, quantity: str, **values: object) -> float:
    return computed(name, **values).quantities[quantity].value


def test_sensitivities_of_figures_5_to_8_by_differences_of_the_exact_pose() -> None:
    """Every drawn effect against central differences of the closures solved by Newton's method, in the mean over the
    yz rectangle; kinks where an effect changes its sign leave 0.2 % between the two quadratures.
    """
    machine = Manipulator()
    x, weight = np.polynomial.legendre.leggauss(16)
    r, z = (grid.ravel() for grid in np.meshgrid(0.475 + 0.175 * x, 0.2 + 0.1 * x, indexing="ij"))
    weights = np.outer(weight, weight).ravel() / 4.0

    def effects(errors: dict[str, float]) -> tuple[float, float, float]:
        moved = [exact_pose(machine, r, z, 0.0, s * error_vector(errors)) for s in (1.0, -1.0)]
        turn, move = (0.5 * (a - b) for a, b in ((moved[0].orientation, moved[1].orientation),
                                                 (moved[0].position, moved[1].position)))  # fmt: skip
        sizes = np.hypot(turn[:, 0], turn[:, 1]), np.abs(turn[:, 2]), np.linalg.norm(move, axis=1)
        squareness, yaw, position = (float(weights @ size) for size in sizes)
        return squareness * 1e3, yaw * 1e3, position * 1e6

    turning, moving = computed("manipulator_sources").tables
    for source, squareness, yaw in zip(*turning.values, strict=True):
        unit = 0.1 if source.startswith("joint_line") else 10.0
        direction = {name: unit * share for name, share in orientation_combinations()[source].items()}
        np.testing.assert_allclose(effects(direction)[:2], (squareness, yaw), rtol=2e-3, atol=1e-6, err_msg=source)
    rows = dict(zip(moving.values[0].tolist(), np.stack(moving.values[1:], axis=1).astype(float), strict=True))
    assert len(rows) == 12
    for source, pair in rows.items():
        stem, _, axis = source.rpartition("_")
        unit = 0.1 if source.startswith("arm_orientation") else 10.0
        for chain, drawn in zip((1, 3), pair, strict=True):
            name = {"a": f"{stem}_{chain}a", "b": f"{stem}_{chain}b", "length": f"{source}_{chain}"}.get(
                axis, f"{stem}_{chain}_{axis}"
            )
            name += "_mrad" if unit == 0.1 else "_um"
            np.testing.assert_allclose(effects({name: unit})[2], drawn, rtol=2e-3, atol=1e-4, err_msg=name)


def test_workspace_of_figure_4_is_bounded_by_circles_of_stretched_chains() -> None:
    """Chains 1 and 2 end on spheres of radius l2 about the arm's circle, chain 3 between circles about its hinge."""
    (table,) = computed("task_ring").tables
    columns = dict(zip((axis.name for axis in table.columns), table.values, strict=True))
    r, low, high = (columns[name].astype(float) for name in ("r_mm", "reached_from_z_mm", "reached_to_z_mm"))
    chosen = (r > 210.0) & np.isfinite(high)
    assert np.sum(chosen) > 70
    rho = np.hypot(r[chosen], 60.0)
    plan = np.sqrt(480.0**2 - (rho - 400.0) ** 2)
    third = np.sqrt((260.0 + 420.0) ** 2 - (r[chosen] - 45.0) ** 2)
    np.testing.assert_allclose(high[chosen], np.minimum(plan, 150.0 + third), atol=0.01)
    np.testing.assert_allclose(low[chosen], np.maximum(-plan, 150.0 - third), atol=0.01)
    task = columns["task_to_z_mm"].astype(float)
    assert set(task[np.isfinite(task)].tolist()) == {300.0}
    assert table.chart is not None and table.chart.marks == {"inner radius": 300.0, "outer radius": 650.0}


@pytest.mark.parametrize("name", CHEAP)
def test_contract(name: str) -> None:
    """What is declared is what comes out, finite, in the declared units; tables are whole."""
    found, own = computed(name), kind(name)
    assert own.name == name
    assert own.about.endswith(".")
    assert own.reference
    if own.outputs:
        assert {one.name: one.unit or "1" for one in own.outputs} == {
            key: one.unit for key, one in found.quantities.items()
        }
    for one in found.quantities.values():
        assert np.isfinite([one.value, one.standard_error]).all()
    for table in found.tables:
        assert len(table.columns) == len(table.values)
        assert len({len(column) for column in table.values}) == 1
        names = {axis.name for axis in table.columns}
        assert table.chart is None or {table.chart.x, *table.chart.y} <= names


@pytest.mark.parametrize("name", CHEAP)
def test_one_that_draws_nothing_says_so(name: str) -> None:
    first, second = (kind(name)().compute({}, np.random.default_rng(seed)) for seed in (2, 3))
    same = all(second.quantities[key].value == one.value for key, one in first.quantities.items())
    assert same is not kind(name).sampled


def test_stages_by_hand() -> None:
    """Uniform zones: half-width over sqrt(3); sums of squares of A t/(e z_c) (section 2)."""
    arcmin = 60 * 180 / np.pi
    k1 = 1.3 * 40 / 64
    flank = np.sqrt(1 - k1**2)
    gains = np.array([2 * flank, 2 * k1, 2.0, 2.0, k1, 0.5, 2.0, 2 * flank])
    widths = np.array([3.0, 2.0, 1.5, 1.0, 4.0, 1.0, 1.0, 1.0]) * 1e-3
    std = np.sqrt(np.sum((gains * widths) ** 2) / 3.0) / (1.3 * 39) * arcmin
    # the eccentricity's +-1 um adds 2 x 0.055 um over sqrt(3), far below a thousandth
    np.testing.assert_allclose(value("backlash_stages", "cycloid_std_arcmin"), std, rtol=1e-3)
    for clearance in (2.0, 20.0):
        mean, spread = (
            value("backlash_stages", f"output_{one}_arcmin", crank_bearing_um=clearance) for one in ("mean", "std")
        )
        np.testing.assert_allclose(mean, 0.5 * clearance * 1e-3 / 36 * arcmin)
        np.testing.assert_allclose(spread, mean / np.sqrt(3.0))


def test_bearing_clearance_of_the_text_is_neither_small_nor_stable() -> None:
    """0.02 mm alone reaches 1.9 arcmin (section 2)."""
    mean = value("backlash_stages", "output_mean_arcmin", crank_bearing_um=20.0)
    np.testing.assert_allclose(2.0 * mean, 1.9, atol=0.02)
    spread = value("backlash_stages", "output_std_arcmin", crank_bearing_um=20.0)
    assert spread > 1.5 * value("backlash_stages", "cycloid_std_arcmin")


def test_adjustment_rows_of_section_6() -> None:
    for label, states in (
        ("q0", (-1.6, 3.7, 5.8, 9.0)),
        ("q5", (-1.314, 1.375, 3.314, 4.857)),
        ("q10", (-0.985, 0.884, 2.486, 4.029)),
        ("ideal", (0.0, 0.0, 0.0, 3.2)),
    ):
        final = [value("assembly_adjustment", f"{label}_state_{k}_mrad") for k in range(1, 5)]
        np.testing.assert_allclose(final, states, atol=6e-4)
    for label, fall in (("q5", 46.0), ("q10", 57.0)):
        found = value("assembly_adjustment", f"{label}_norm_fall_percent")
        np.testing.assert_allclose(found, fall, atol=0.5)
    after = value("assembly_adjustment", "q5_norm_fall_percent", insertion="after")
    np.testing.assert_allclose(after, 74.0, atol=0.5)


def test_tolerance_ratio_in_closed_form() -> None:
    """v ~ (a/J^2)^(1/3): J is 2 of a crankshaft and 1 of a gear in the sum of the angles."""
    np.testing.assert_allclose(value("tolerance_ratio", "equal_costs"), 0.25 ** (1 / 3))
    rss = value("tolerance_ratio", "equal_costs", composite="rss")
    np.testing.assert_allclose(rss, 0.5 ** (1 / 3))
    steep = value("tolerance_ratio", "equal_costs", exponent=2.0)
    np.testing.assert_allclose(steep, 0.25 ** (1 / 4))


def test_absent_parts_are_less_adjusted_the_dearer_it_is() -> None:
    shares = [value("assembly_structure", "absent_share_percent", absent_weight=weight) for weight in (1e2, 1e3, 1e4)]
    assert shares[0] > shares[1] > shares[2]
    np.testing.assert_allclose(shares[1] / shares[2], 10.0, rtol=0.05)


def test_sources_of_the_manipulator() -> None:
    """Physics of the manipulator, section 5."""
    for quantity, wanted in (
        ("orientation_sources", 18), ("orientation_rank", 17), ("orientation_acting", 17),
        ("position_sources", 36), ("chain_3_squareness", 0.0), ("joint_distance_3", 0.0),
        ("rod_length_1_squareness", 14.345), ("rod_length_1_yaw", 5.095),
        ("rod_length_3_yaw", 11.383),
    ):  # fmt: skip
        found = value("manipulator_sources", quantity)
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-9)


def test_kinds_rank_differently_by_their_largest_source_and_by_their_sum() -> None:
    """From the table of effects, by which the ranks are no part of what they are checked by."""
    table, _ = computed("manipulator_sources").tables
    names = [one.name for one in table.columns]
    effects = pd.DataFrame(dict(zip(names, table.values, strict=True)))
    squares = effects.set_index(effects["source"].str.extract(r"^(rod_length|joint_[a-z]+)")[0])
    for output in ("squareness", "yaw"):
        by_kind = squares.groupby(level=0)[f"{output}_mrad"]
        orders = {"": by_kind.max(), "rss_": by_kind.apply(lambda one: (one**2).sum() ** 0.5)}
        for how, sizes in orders.items():
            found = value("manipulator_sources", f"{output}_{how}rank")
            assert found == sizes.rank(ascending=False)["rod_length"]
            lead = sizes["rod_length"] / sizes.drop("rod_length").max()
            np.testing.assert_allclose(value("manipulator_sources", f"{output}_{how}lead"), lead)
    assert value("manipulator_sources", "yaw_rank") == 1.0
    assert value("manipulator_sources", "yaw_rss_rank") == 2.0


def test_weighting_by_volume_is_that_of_the_notes() -> None:
    found = value("manipulator_sources", "rod_length_1_squareness", index="volume")
    np.testing.assert_allclose(found, 14.389, rtol=1e-4)


def test_directions() -> None:
    """An origin moved along x acts as cos, 0 at some azimuth: the change is all of it."""
    for group in ("arm", "rod", "platform", "base_together"):
        assert value("manipulator_directions", f"{group}_percent") < 1e-9
    np.testing.assert_allclose(value("manipulator_directions", "base_percent"), 100.0, atol=1e-9)


def test_ring_that_is_too_wide_is_not_reached() -> None:
    assert value("task_ring", "reached_percent") == 100.0
    wide = value("task_ring", "reached_percent", ring_r_mm=(300.0, 950.0))
    assert 40.0 < wide < 95.0
    length = value("task_ring", "length_mm", ring_r_mm=(300.0, 950.0))
    np.testing.assert_allclose(length, 650.0)


# ---------------------------------------------------------------- the genetic algorithm


def test_more_generations_end_nearer() -> None:
    own = {"setting": "crossover", "a": 0.99, "b": 0.99, "seeds": 3}
    short = value("ga_settings", "a_gap_percent", generations=10, **own)
    long = value("ga_settings", "a_gap_percent", generations=60, **own)
    assert 0.0 < long < 0.5 * short


def test_equal_settings_share_the_seeds() -> None:
    own = {"setting": "crossover", "a": 0.99, "b": 0.99, "seeds": 3, "generations": 10}
    assert value("ga_settings", "a_nearer_percent", **own) == 50.0
    assert value("ga_settings", "a_gap_percent", **own) == value("ga_settings", "b_gap_percent", **own)


def study(folder: object, rows: list[tuple[float, int, float, float]]) -> None:
    columns = ["algorithm.population", "replicate", "gap_percent", "evaluations_to_99"]
    frame = pd.DataFrame(rows, columns=columns).assign(status="done")
    frame["algorithm.mutation.probability"] = 0.08
    frame.to_csv(f"{folder}/study.csv", index=False)


def test_runs_of_a_study_are_paired_by_seed(tmp_path: object) -> None:
    study(tmp_path, [
        (80.0, 0, 0.5, 3000.0), (80.0, 1, 1.5, np.nan), (80.0, 2, 0.1, 1000.0),
        (20.0, 0, 1.0, 2000.0), (20.0, 1, 2.0, 4000.0), (20.0, 2, 0.4, 500.0),
        (40.0, 0, 9.0, 9000.0),
    ])  # fmt: skip
    found = kind("ga_settings")().compute({"study": str(tmp_path)}, np.random.default_rng(0))
    wanted = {"seeds": 3.0, "a_gap_percent": 0.5, "b_gap_percent": 1.0, "a_nearer_percent": 100.0,
              "a_slower_percent": 100.0, "a_evaluations": 3000.0}  # fmt: skip
    assert {name: found.quantities[name].value for name in wanted} == wanted


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"study": "/nowhere"}, "study.csv does not exist"),
        ({"setting": "population", "a": 2.5}, "whole number"),
        ({"setting": "crossover", "a": 1.5}, r"must lie in \[0, 1\], got 1.5"),
    ],
)
def test_faults(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        kind("ga_settings")().compute(values, np.random.default_rng(0))  # type: ignore[arg-type]


def test_study_without_the_settings_is_refused(tmp_path: object) -> None:
    study(tmp_path, [(80.0, 0, 0.5, 1.0), (40.0, 0, 0.5, 1.0)])
    for values, said in (({}, "it has 40, 80"), ({"setting": "crossover"}, "has no algorithm.crossover.probability")):
        own = values | {"study": str(tmp_path)}
        with pytest.raises(InputError, match=said):
            kind("ga_settings")().compute(own, np.random.default_rng(0))
