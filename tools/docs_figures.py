"""Writes the figures of README.md and docs/*.md that a run gives: `python -m tools.docs_figures`.

A figure has a mark after it, as in `98.8 %<!--=closed_form:printed_yield_percent-->`: the source, a
function of `SOURCES`, and the name of the figure there, with `_` or a space between its words. The
page keeps the number of decimals and the sign, and a figure that is right within one unit of its
last digit, so that no page hangs on a processor's rounding; a test compares each figure with its
source. Tables of the main job, which `make figures` writes, are read from docs/figures, where other
tests compare them with the model.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from scipy.signal import fftconvolve

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.conditional import Asked, estimated_optimum
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.api import run
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.gap import analysis_result
from tolevo.commands.gap.read import read_data
from tolevo.commands.reproduce.calculations.reducer import ReducerMonteCarlo, StaggeredAssembly
from tolevo.configuration.reader import read
from tolevo.models.machines import Inspection, Machine
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_backlash.shift import TERMS
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.declared import DISC_TO_DISC
from tolevo.problems.settings import Bound, Settings, VariableSetting
from tolevo.problems.tolerance_problem import ToleranceProblem

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "docs" / "figures"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
MARK = re.compile(
    r"(?P<figure>[+-]?\d+(?:\.\d+)?)(?P<unit>(?: %|')?)(?P<mark><!-- ?=(?P<source>\w+)[: ](?P<name>.+?) ?-->)"
)
Figures = Mapping[str, float]
LEVEL = 1.0
"""Backlash [arcmin] of which the pages speak."""
REDUCERS = {
    "rv20e_like": (2.8, 1.7, 1.5, 1.2, 1.0),
    "rv80e_like": (1.6, 1.2, 0.9, 0.8, 0.55),
    "cycloidal_stage": (2.8, 1.7, 1.3, 1.0, 0.75),
}
"""Levels of backlash [arcmin] of reducers of other sizes."""
SHORT = (
    ("share of the variance of pins and holes common to a unit", "share_pins"),
    ("share of the variance of the discs common to a unit", "share_discs"),
    ("share of the variance of the planets' clearances common to a unit", "planet_share"),
    ("what counts as interference ", ""),
    (", in at most 5 %", ""),
    ("errors between discs (pin circle, bores, journals)", "between discs"),
)
"""Words of the table of assumptions, and those of the marks."""


@cache
def main_problem() -> RvReducer:
    """The problem of the main job."""
    problem = read(ROOT / "configs" / "rv40e_backlash.toml").problem
    assert isinstance(problem, RvReducer)
    return problem


def by_contact(design: Mapping[str, float]) -> Figures:
    """An allocation on the fresh units of the main job, and how much its front costs there."""
    problem = main_problem()
    complete = problem.fixed | dict(design)
    row = np.array([complete[name] for name in problem.names])
    evaluation = problem.evaluation(row, searching=False)
    backlash = evaluation.value("backlash_max_arcmin")
    cost = float(problem.cost_of(row[None])[0])
    return {
        "cost": cost,
        "yield_percent": evaluation.value("yield_percent"),
        "backlash": backlash,
        "interference_percent": 100.0 * evaluation.value("interference_probability"),
        "above front percent": 100.0 * (cost / front_cost(backlash) - 1.0),
    }


def front_cost(backlash: float) -> float:
    """Cost of the main job's stored front at a backlash [arcmin], between its points geometrically."""
    front = pd.read_csv(DATA / "rv40e_backlash_front.csv").sort_values("backlash_max_arcmin")
    return float(np.exp(np.interp(backlash, front["backlash_max_arcmin"], np.log(front["cost"]))))


def closed_form() -> Figures:
    """The least cost of document B's closed form at 1 arcmin in both readings, proven, and by contact."""
    figures: dict[str, float] = {}
    for reading in ("printed", "consistent"):
        limits = {"interference_probability": Bound(high=0.05), "backlash_arcmin": Bound(high=LEVEL)}
        problem = RvBacklash(Settings(parameters={"reading": reading}, limits=limits, objectives=("cost",)))
        design = problem.complete(search(problem, Exact(), Budget(), 1).chosen)
        cost = problem.outputs_of(design)["cost"]
        found = by_contact(dict(zip(problem.names, design[0].tolist(), strict=True)))
        figures |= {f"{reading} {name}": value for name, value in found.items()}
        figures[f"{reading} bound"] = float(proof(problem, {"cost": cost}, 1).bound[0])
    return figures


def bounds() -> Figures:
    """Bounds of the cost of the main job at levels of backlash, and how far below its front they lie in percent."""
    figures: dict[str, float] = {}
    for level in (1.0, 1.48):
        bound = main_problem().cost_bound().least_costs({"backlash_max_arcmin": np.array([level])}, 1)[0]
        figures |= {f"at {level:g}": bound, f"below {level:g}": 100.0 * (1.0 - bound / front_cost(level))}
    problem = main_problem()
    estimate = estimated_optimum(problem, Asked({"backlash_max_arcmin": LEVEL}, problem.starts()[2]))[0]
    return figures | {"estimate 1": estimate, "short of front 1": 100.0 * (1.0 - estimate / front_cost(LEVEL))}


def references() -> Figures:
    """The references of the main job by contact: number from 1, and name."""
    problem = main_problem()
    figures: dict[str, float] = {}
    for at, row in enumerate(problem.references().values(), 1):
        found = by_contact(dict(zip(problem.names, row.tolist(), strict=True)))
        figures |= {f"{at} {name}": value for name, value in found.items()}
    return figures


def readings() -> Figures:
    """Document B's zones by its closed form in both readings, without and with its stagger."""
    figures: dict[str, float] = {}
    for reading in ("printed", "consistent"):
        problem = RvBacklash(Settings(parameters={"reading": reading}))
        outputs = problem.outputs_of(np.stack(list(problem.references().values())))
        for name, values in outputs.items():
            scale = 100.0 if name == "interference_probability" else 1.0
            figures[f"{reading} {name}"], figures[f"{reading} staggered {name}"] = (scale * values).tolist()
    return figures


def alone() -> Figures:
    """Error [um] at which the mean geometric backlash reaches 1 arcmin while all others stay at the middles of document
    B's zones, by reading and variable; and the most that the eccentricity adds within 10 um.
    """
    figures: dict[str, float] = {}
    for reading in ("printed", "consistent"):

        def mean(variable: str = "", mid: float = 0.0, reading: str = reading) -> float:
            moved = {variable: VariableSetting(mid=mid)} if variable else {}
            problem = RvBacklash(Settings(parameters={"reading": reading}, variables=moved))
            outputs = problem.outputs_of(problem.references()["document B"][None, :])
            return float(outputs["backlash_geometric_mean_arcmin"][0])

        plain = RvBacklash(Settings(parameters={"reading": reading}))
        middles = {v.name: float(v.mid or 0.0) for v in plain.variables}
        usual, eccentricity = mean(), "eccentricity_um"
        for name in TERMS:
            slope = mean(name, middles[name] + 1.0) - usual
            if name != eccentricity and abs(slope) > 1e-9:
                figures[f"{reading} {name}"] = middles[name] + (LEVEL - usual) / slope
        figures[f"{reading} {eccentricity}"] = max(mean(eccentricity, d) for d in np.linspace(-10.0, 10.0, 81)) - usual
        phi_3 = figures_of_document(reading)["phi_3_arcmin"]
        figures[f"{reading} crank_bearing_um"] = (LEVEL - usual + phi_3) / phi_3  # phi_3 is that of 1 um, the middle
    return figures


def figures_of_document(reading: str) -> Figures:
    """Outputs of document B's zones by its closed form."""
    problem = RvBacklash(Settings(parameters={"reading": reading}))
    return {name: float(v[0]) for name, v in problem.outputs_of(problem.references()["document B"][None, :]).items()}


def by_definition() -> Figures:
    """Units within 1 arcmin of the references on 16,384 units, in percent: by number of the
    reference from 1, with document B's phi_1 or the default, without or with errors between discs.
    """
    figures: dict[str, float] = {}
    for cosine in (False, True):
        for between in (False, True):
            nil = {} if between else {name: VariableSetting(value=0.0) for name in DISC_TO_DISC}
            parameters = {"involute_cosine": cosine, "report_units": 16_384}
            problem = RvReducer(Settings(seed=1, parameters=parameters, variables=nil))
            for at, row in enumerate(main_problem().references().values(), 1):
                known = dict(zip(main_problem().names, row.tolist(), strict=True)) | problem.fixed
                design = np.array([known[name] for name in problem.names])
                name = f"{at} {'default' if cosine else 'B'} {'with' if between else 'without'}"
                figures[name] = problem.evaluation(design, searching=False).value("yield_percent")
    return figures


def least_cost(name: str, *overrides: str) -> tuple[ToleranceProblem, np.ndarray]:
    """The problem of a configuration with cost as the only objective, and its optimum (1, variables)."""
    found = read(ROOT / name, overrides=['objectives.minimise=["cost"]', *overrides])
    assert found.problem is not None
    result = search(found.problem, Exact(), found.budget, found.seed)
    return found.problem, found.problem.complete(result.chosen)


def least_costs() -> Figures:
    """Least cost at 1 arcmin by contact, grade 4, with document B's phi_1 or the default, without and
    with errors between discs; and its yield on 16,384 other units.
    """
    figures: dict[str, float] = {}
    path = "configs/rv40e_least_cost.toml"
    for definition, between in product(("B", "default"), ("without", "with")):
        fixed = [f"variables.{name}.value=0.0" for name in DISC_TO_DISC] if between == "without" else []
        fixed += [f"parameters.involute_cosine={'true' if definition == 'default' else 'false'}"]
        problem, design = least_cost(path, "variables.involute_grade.value=4", *fixed)
        others = read(ROOT / path, overrides=["seed=2", "parameters.report_units=16384", *fixed]).problem
        assert isinstance(others, RvReducer)
        figures[f"{definition} {between}"] = float(problem.cost_of(design)[0])
        evaluation = others.evaluation(design[0], searching=False)
        figures[f"{definition} {between} yield"] = evaluation.value("yield_percent")
    return figures


def inspected() -> Figures:
    """Good parts of a machine of 4 um that are inspected at 6 um, where a part costs 11; and how much of
    the sum of five parts that are inspected at 1.5 sigma lies beyond three of its standard deviations.
    """
    machine = Machine("m", 4.0, 11.0, 0.0, Inspection(0.0))
    good = machine.good_parts(np.array([6.0]))
    step = 0.002
    x = np.arange(-6.0, 6.0 + step / 2, step)
    one, density = np.exp(-0.5 * (x / 4.0) ** 2), np.ones(1)
    for _ in range(5):
        density = fftconvolve(density, one / one.sum())
    beyond = np.abs(step * (np.arange(len(density)) - len(density) // 2)) > 3.0 * np.sqrt(5.0) * good.std
    figures = {"std": good.std, "passed percent": 100.0 * good.passed, "cost": good.cost}
    return {name: float(value[0]) for name, value in figures.items()} | {
        "five outside percent": 100.0 * float(density[beyond].sum())
    }


def batch() -> Figures:
    """The answer of the worked example of docs/gap.md."""
    plan = read_gap(ROOT / "docs" / "rv40e_batch" / "gap.toml")
    result = analysis_result(plan, read_data(plan, ROOT / "docs" / "rv40e_batch" / "units.csv"))
    sizes = {"before": result.gap_before, "after": result.gap_after, "chance": result.noise_floor}
    figures = {name: float(values["backlash_arcmin"]) for name, values in sizes.items()}
    for effect in result.effects:
        figures |= {f"{effect.name} {parameter.name}": float(parameter.value) for parameter in effect.parameters}
    return figures


def front() -> Figures:
    """The main job's stored front."""
    return {"cost at 1": front_cost(LEVEL)}


def assumptions() -> Figures:
    """What the assumptions of the main job cost at its point at 1 arcmin, by assumption and value.

    `change` is in percent of the cost as it is.
    """
    table = pd.read_csv(DATA / "rv40e_backlash_assumptions.csv", dtype={"value": str}, keep_default_na=False)
    base = float(table["cost"].iloc[0])
    figures = {"as it is": base}
    for assumption, value, cost in table[["assumption", "value", "cost"]].iloc[1:].itertuples(index=False):
        name = f"{assumption} {value}"
        for words, short in SHORT:
            name = name.replace(words, short)
        figures |= {name: float(cost), f"{name} change": 100.0 * (float(cost) / base - 1.0)}
    figures["between discs 0 saves"] = -figures["between discs 0 change"]
    figures["interference most"] = max(figures["share of turn"], figures["overlap, beyond 0.3 arcmin"]) - base
    return figures


def other_reducers() -> Figures:
    """Least cost of the reducers that are not the RV-40E by contact, by configuration and level [arcmin]."""
    figures: dict[str, float] = {}
    for name, levels in REDUCERS.items():
        for level in levels:
            problem, design = least_cost(f"configs/{name}.toml", f"limits.backlash_max_arcmin={level}")
            figures[f"{name} {level}"] = float(problem.cost_of(design)[0])
    return figures


def robots() -> Figures:
    """Least cost of the manipulator with reducers: as built, calibrated, calibrated with held flanks,
    at A of 0.15 mm and at R of 0.05 mm.
    """
    figures: dict[str, float] = {}
    for case, settings in {
        "built": (),
        "calibrated": ('parameters.calibrated="position"',),
        "held": ('parameters.calibrated="position"', 'parameters.flanks="held"'),
    }.items():
        for level, limit in (("A", "pose_accuracy_mm=0.15"), ("R", "pose_rms_mm=0.05")):
            problem, design = least_cost("configs/robot_manipulator.toml", f"limits.{limit}", *settings)
            outputs = problem.outputs_of(design)
            figures |= {f"{case} {level} {name}": float(values[0]) for name, values in outputs.items()}
    return figures


def document_units() -> Figures:
    """A million units of document B by its closed form as printed, and its convolution over the stagger."""
    figures: dict[str, float] = {}
    for clearance, stagger in product((2.0, 20.0), (0.0, 0.2)):
        values = {"units": 10**6, "crank_bearing_um": clearance, "stagger_arcmin": stagger}
        found = ReducerMonteCarlo().compute(values, np.random.default_rng(1)).quantities
        figures |= {f"{clearance:g} {stagger} {name}": quantity.value for name, quantity in found.items()}
    for stagger in (0.2, 0.4):
        found = StaggeredAssembly().compute({"stagger_arcmin": stagger}, np.random.default_rng(1)).quantities
        figures |= {f"convolved {stagger} {name}": quantity.value for name, quantity in found.items()}
    return figures


def promised() -> Figures:
    """Least cost and assurance in percent of the promises by units, by configuration and statement."""
    figures: dict[str, float] = {}
    for name in ("reducer", "robot"):
        with TemporaryDirectory() as folder:
            run(ROOT / "docs" / "promise" / "units" / f"{name}.toml", folder, overwrite=True)
            table = pd.read_csv(Path(folder, "promise.csv"))
        for statement, cost, assurance in table[["statement", "cost", "assurance_percent"]].itertuples(index=False):
            figures |= {f"{name} {statement} cost": cost, f"{name} {statement} assurance": assurance}
    return figures


SOURCES: Mapping[str, Callable[[], Figures]] = {
    one.__name__: cache(one)
    for one in (
        closed_form,
        bounds,
        references,
        readings,
        alone,
        front,
        assumptions,
        by_definition,
        least_costs,
        inspected,
        batch,
        other_reducers,
        robots,
        document_units,
        promised,
    )
}


SLOW = ("by_definition", "least_costs", "other_reducers", "robots", "promised")
"""Sources that take up to two minutes."""


def rewritten(text: str, sources: Mapping[str, Callable[[], Figures]] = SOURCES) -> str:
    """A page with the figures of its sources; marks of other sources stay as they are."""

    def figure(found: re.Match[str]) -> str:
        if found["source"] not in sources:
            return found[0]
        figures = {name.replace(" ", "_"): value for name, value in sources[found["source"]]().items()}
        value, written = figures[found["name"].replace(" ", "_")], found["figure"]
        decimals = len(written.partition(".")[2])
        if abs(value - float(written)) < 10.0**-decimals:
            return found[0]
        sign = "+" if written[0] == "+" else ""
        return f"{value:{sign}.{decimals}f}{found['unit']}{found['mark']}"

    return MARK.sub(figure, text)


def main() -> int:
    """Write every page anew."""
    for page in PAGES:
        text = page.read_text("utf-8")
        if (new := rewritten(text)) != text:
            page.write_text(new, "utf-8")
            print(f"{page.relative_to(ROOT)} has new figures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
