"""Result records: what workflows hand to reports and to the user's scripts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from .registry import Kinds
from .units import drawing_number

if TYPE_CHECKING:
    import pandas as pd

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Table:
    """The one declaration of a table of a result: from it the file is written, listed in the manifest, read back and
    checked, and drawn on the page.

    `file` is its name, with the ending of its format (.csv or .parquet). `columns` are those that the page reads: a
    stored table that lacks one is left out, with a remark. With a `heading` it stands in a section of the page of its
    own, below the `text` that explains its rows and columns; the rows whose column `marked[0]` is `marked[1]` are
    emphasised. A column has its unit at the end of its name.
    """

    file: str
    columns: tuple[str, ...]
    heading: str
    text: str
    marked: tuple[str, str]


TABLE = "table"
"""Key of a declaration in the metadata of the field that holds the table."""


def declared(
    file: str, *columns: str, heading: str = "", text: str = "", marked: tuple[str, str] = ("", "")
) -> dict[str, Table]:
    """The metadata of a field of a result that holds a table, or tables by their label."""
    return {TABLE: Table(file, columns, heading, text, marked)}


def optional(file: str, *columns: str, **more: Any) -> Any:
    """The field of a result that holds a table, None where there is none."""
    return field(default=None, metadata=declared(file, *columns, **more))


def tables_of(result: Any) -> dict[str, Table]:
    """The tables that a result, or its class, declares, by the names of its fields."""
    return {held.name: held.metadata[TABLE] for held in fields(result) if TABLE in held.metadata}


@dataclass(frozen=True, slots=True)
class Axis:
    """A column of a result that is drawn: its name, unit, and what it means."""

    name: str
    unit: str
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Bars:
    """A bar chart: what it shows, the unit of its values, and one value per label."""

    title: str
    unit: str
    labels: tuple[str, ...]
    values: tuple[float, ...]


@dataclass(frozen=True)
class CommandOutcome(Generic[Result]):
    """How a command ended ("done", "interrupted", a run also "no_feasible_point"), the directory of its files, its
    summary in lines, and its result; None where it is no run and was interrupted, or was complete before.
    """

    status: str
    folder: Path
    lines: tuple[str, ...]
    result: Result


@dataclass(frozen=True, slots=True)
class UnitsShown:
    """Units of a design: what their backlash means in words, the turn of one unit, the population, rotation by torque.

    `turn` has the columns turn_deg, cycloid_arcmin (below zero flanks overlap), backlash_arcmin and
    measured (the positions that count); `population` backlash_max_arcmin, share_within_percent of
    the units, and share_percent since the row before. `torque_rotation` has torque_Nm, rotation_median_arcmin and
    rotation_high_arcmin (of the units of median and of high lost motion), and lost_motion (the torques it is taken at).
    """

    words: tuple[str, ...]
    turn: pd.DataFrame
    population: pd.DataFrame
    torque_rotation: pd.DataFrame


FORMAT = 1
"""Version of the files of a run: `summary.json` names it; a reader refuses what is newer."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """One finished optimisation.

    `front`, `references`, `convergence` are the tables of the files of these names; `summary` is
    `summary.json`; `objectives` are the axes of the front, `variables` the design variables,
    `bars` charts of the problem itself, and `configuration` is the resolved TOML. Where effects act
    in the model, `before` is the front without them and `moved` how the allocation moves.
    `choices`, `choice_sensitivity`, `allocation`, `contributions` and `exact_front` are the tables
    of the files of these names, None where there is none. `overlays` are fronts of other algorithms
    by label (`overlays.csv`). `unit_turn`, `population`, `torque_rotation` and `assumptions_cost`
    are the tables of the files of these names, of problems that know units; `analysis` has the
    requirements of a stack at its loosest and at its chosen tolerances, `requirements` and `drivers` are
    of those with several.
    `prices`, `changes` and `relaxed` (the fronts whose limits are as loose as those of a reference, under
    its `label`) are those of these names, and `tolerances` the records of
    `tolerances.json`: what a drawing and a price need to know of each variable. `promise`,
    `next_parts` are the tables of these names, of runs that promise a yield, `capability` that of
    runs with measured parts.
    """

    title: str
    front: pd.DataFrame = field(metadata=declared("front.csv"))
    references: pd.DataFrame = field(metadata=declared("references.csv", "label", "feasible", "violated_limits"))
    convergence: pd.DataFrame = field(
        metadata=declared("convergence.csv", "evaluations", "hypervolume", "feasible_fraction")
    )
    summary: Mapping[str, Any]
    objectives: tuple[Axis, ...]
    variables: tuple[Axis, ...] = ()
    notes: tuple[str, ...] = ()
    bars: tuple[Bars, ...] = ()
    configuration: str = field(default="", repr=False)
    before: pd.DataFrame | None = optional("front_without_effects.csv")
    moved: pd.DataFrame | None = optional(
        "allocation_moved.csv",
        heading="Effects",
        text="The change of the allocation by the effects in the model. For every level of the second objective "
        "the table has the cheapest point of the front without the effects (before), the values of the same "
        "design with them (kept), and the cheapest point with them (after). front_without_effects.csv has "
        "the whole front, allocation_moved.csv this table.",
        marked=("allocation", "after"),
    )
    choices: pd.DataFrame | None = optional("choices.csv", "choice", "meaning", "point")
    choice_sensitivity: pd.DataFrame | None = optional("choice_sensitivity.csv", "choice", "same")
    allocation: pd.DataFrame | None = optional("allocation.csv", "point", "variable", "rounded")
    contributions: pd.DataFrame | None = optional("contributions.csv", "point", "output", "explained")
    exact_front: pd.DataFrame | None = optional("exact_front.csv")
    overlays: Mapping[str, pd.DataFrame] = field(default_factory=dict, metadata=declared("overlays.csv", "label"))
    unit_turn: pd.DataFrame | None = optional("unit_turn.csv", "turn_deg", "backlash_arcmin", "measured")
    population: pd.DataFrame | None = optional(
        "population.csv", "backlash_max_arcmin", "share_within_percent", "share_percent"
    )
    torque_rotation: pd.DataFrame | None = optional(
        "torque_rotation.csv", "torque_Nm", "rotation_median_arcmin", "rotation_high_arcmin", "lost_motion"
    )
    assumptions_cost: pd.DataFrame | None = optional("assumptions_cost.csv", "assumption", "value", "cost")
    analysis: pd.DataFrame | None = optional("analysis.csv")
    requirements: pd.DataFrame | None = optional("requirements.csv", "requirement", "multiplier_cost_per_unit")
    drivers: pd.DataFrame | None = optional("drivers.csv", "part", "driven_by")
    prices: pd.DataFrame | None = optional("prices.csv", "point", "output", "price", "source")
    changes: pd.DataFrame | None = optional("changes.csv", "point", "variable", "to", "cost_change", "breaks")
    relaxed: pd.DataFrame | None = optional("relaxed.csv", "label")
    tolerances: tuple[Mapping[str, Any], ...] = ()
    promise: pd.DataFrame | None = optional("promise.csv", "statement", "cost", "assurance_percent")
    next_parts: pd.DataFrame | None = optional("next_parts.csv", "part", "shadow_gain")
    capability: pd.DataFrame | None = optional("capability.csv", "part", "index", "value")

    @property
    def answers(self) -> Mapping[str, str]:
        """The question and the results of a run, a sentence per entry: `asked`, `found`,
        `published`, `limits`, `promise` and `proof`, as far as the summary has them.
        """
        stated = self.summary.get("answers")
        return stated if isinstance(stated, Mapping) else {}


def unit_of_cost(summary: Mapping[str, Any]) -> str:
    """The unit that every cost of a run has; empty where costs are relative."""
    costs = summary.get("costs")
    return str(summary.get("currency") or (costs.get("currency") if isinstance(costs, Mapping) else "") or "")


def mechanism_lines(summary: Mapping[str, Any]) -> list[str]:
    """The subject of a run, where its configuration states it: the mechanism, its requirements, the
    currency of its costs and which of them are assumed.
    """
    return [*_mechanism(summary.get("mechanism")), *_money(summary.get("costs"))]


def _money(known: object) -> list[str]:
    """Like "costs in EUR; assumed: pin_radius_um (an assumed unit costs 25 EUR)"."""
    if not isinstance(known, Mapping) or not known.get("currency"):
        return []
    currency, assumed = str(known["currency"]), list(known.get("assumed") or ())
    text = f"costs in {currency}" + (f"; assumed: {', '.join(map(str, assumed))}" if assumed else "")
    scale = known.get("scale_assumed")
    if assumed and isinstance(scale, int | float):
        text += f" (an assumed unit costs {scale:g} {currency})"
    return [text]


def _mechanism(known: object) -> list[str]:
    """The mechanism and its requirements, a line per entry."""
    if not isinstance(known, Mapping):
        return []
    mechanism = _description_line(known)
    requirements = [requirement for requirement in known.get("requirements") or () if isinstance(requirement, Mapping)]
    alone = len(requirements) == 1 and requirements[0].get("name") == known.get("name")
    lines = [
        f"requirement {_description_line(requirement)}"
        for requirement in requirements
        if _description_line(requirement)
    ]
    return lines if alone else [*([f"mechanism {mechanism}"] if mechanism else []), *lines]


def _description_line(known: Mapping[str, Any]) -> str:
    """One line, like "end play, at most 0.2 mm (drawing GB-100): play of the shaft"."""
    low, high, unit = (known.get(key) for key in ("lower", "upper", "unit"))
    name, ends = str(known.get("name") or ""), f" {unit}" if unit else ""
    if limits := limits_text(low, high):
        name += f", {limits}{ends}"
    drawing, description = known.get("drawing"), known.get("description")
    name += f" (drawing {drawing})" if drawing else ""
    return name + (f": {description}" if description else "")


def model_lines(summary: Mapping[str, Any]) -> list[str]:
    """The model that a run used, where there are several: a line, and a further line per choice
    that another model was used for. No line where there is only a single model.
    """
    statement = str(summary.get("model_statement") or "")
    if not statement:
        return []
    choices = summary.get("choices") or {}
    labels = {name: str(choice.get("model") or statement) for name, choice in choices.items()}
    return [f"model: {statement}", *(f"{name}: {label}" for name, label in labels.items() if label != statement)]


@dataclass(frozen=True, slots=True)
class Response:
    """What a study measures of every run: its name, direction, and the best value there can be."""

    name: str
    larger_is_better: bool
    best: float | None = None


@dataclass(frozen=True, slots=True)
class Varied:
    """A key that a study varies; `base` is its value in the run configuration."""

    key: str
    base: float | int | str | None
    categorical: bool = False
    log: bool = False


@dataclass(frozen=True, slots=True)
class Verdict:
    """An interpretation of a figure and its test: "holds", "does not hold", "not shown" or
    "undecided".
    """

    figure: str
    key: str
    levels: tuple[float | int | str, ...]
    response: str
    verdict: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Recommendation:
    """The best observed settings for one response; `shown` says whether a test supports them, and
    `sentence` which settings to use: these, or those that they are not shown to beat.
    """

    response: str
    point: int
    settings: Mapping[str, Any]
    shown: bool
    recovered: tuple[float, float, float]
    """Fraction of the reference's distance to the best that they recover: value, low, high."""
    sentence: str


@dataclass(frozen=True, slots=True)
class StudyResult:
    """One finished study.

    `table`, `sensitivity` and `tests` are the files of these names (`study.csv`, ...). `medians`
    has the columns response, point, median, low, high, level, n, failed, reached. `courses` has,
    per key and level of a design that changes one key at a time, the course of a run over its
    generations: key, level, generation, median, low, high, and `optimum` where one is proven.
    `mechanism` holds its labels, as far as they are stated.
    """

    title: str
    kind: str
    design: pd.DataFrame
    table: pd.DataFrame = field(metadata=declared("study.csv"))
    responses: tuple[Response, ...]
    varied: tuple[Varied, ...]
    medians: pd.DataFrame = field(metadata=declared("medians.csv"))
    sensitivity: pd.DataFrame = field(metadata=declared("sensitivity.csv"))
    tests: pd.DataFrame = field(metadata=declared("tests.csv"))
    courses: pd.DataFrame
    course_of: str
    recommendations: tuple[Recommendation, ...]
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[str, ...] = ()
    configuration: str = field(default="", repr=False)
    mechanism: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class GapTables:
    """The tables of a gap analysis (`commands/gap/records.py` has the rest of its result).

    `residuals` has one row per measurement in the order of measuring: the inputs; `block`; and for each output O its
    measured value `O`, whether it is an outlier (`O_outlier`), the recalibrated model `O_predicted` and with the
    effects `O_corrected`, the residuals (measured less predicted) `O_before` and `O_after`, both on held-out rows
    (`O_before_held_out`, `O_after_held_out`), the residual given the named effects alone (`O_remainder`), and the
    noise `O_noise`. `spectrum` has the columns output, order, before, after, threshold (amplitudes in the unit of the
    output). `units` holds the distributions of a batch (empty without one): output, share, and the value that this
    fraction of the units stays below, measured, and drawn from the model before and after. `next_points` are the
    operating points of `next_measurement` in the order of measuring.
    """

    residuals: pd.DataFrame = field(metadata=declared("residuals.parquet"))
    spectrum: pd.DataFrame
    units: pd.DataFrame
    next_points: pd.DataFrame | None = optional("next_measurement.csv")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimsTables:
    """The tables of recomputed claims (`commands/reproduce/records.py` has the rest of the result): `table` is
    `claims.csv`, which has several numbers of a claim as one text, and `counts` the number of claims by document and
    verdict.
    """

    table: pd.DataFrame = field(metadata=declared("claims.csv"))
    counts: pd.DataFrame


@dataclass(frozen=True, slots=True)
class AnalysisResult:
    """One finished analysis of a stack, without a search.

    `requirements`, `contributions` and `histograms` are the tables of the files of these names,
    `tolerances` has a row for each part: unit, nominal, middle and half-width of its zone. `summary` is
    `summary.json`; `quick` the model of second order that the page calculates with, empty where no
    requirement has one. `prices`, `budgets` and `changes` are what it costs, None where that is not known.
    """

    title: str
    requirements: pd.DataFrame = field(metadata=declared("requirements.csv"))
    contributions: pd.DataFrame = field(metadata=declared("contributions.csv"))
    histograms: pd.DataFrame = field(metadata=declared("histograms.csv"))
    tolerances: pd.DataFrame = field(
        metadata=declared(
            "tolerances.csv",
            heading="Tolerances",
            text="The zones that were analysed. A part that is to be searched is analysed at the tolerance that is "
            "stated beside its range, else at the loosest one that it may have.",
        )
    )
    summary: Mapping[str, Any]
    quick: Mapping[str, Any]
    configuration: str = field(default="", repr=False)
    prices: pd.DataFrame | None = optional("prices.csv")
    budgets: pd.DataFrame | None = optional("budgets.csv")
    changes: pd.DataFrame | None = optional("changes.csv")


def limits_text(low: float | None, high: float | None) -> str:
    """Limits as they were stated: "0.1 to 0.5", "at most 0.2"; empty where there are none (None, or not a number)."""
    low, high = (None if end is None or end != end else end for end in (low, high))
    if low is not None and high is not None:
        return f"{drawing_number(low)} to {drawing_number(high)}"
    if low is not None:
        return f"at least {drawing_number(low)}"
    return "" if high is None else f"at most {drawing_number(high)}"


def range_text(low: float, high: float) -> str:
    """A range in words, as "-0.15 to 0.55"; empty where an end is not known."""
    return "" if low != low or high != high else f"{low:.5g} to {high:.5g}"


def worst_case_text(row: Mapping[str, Any]) -> str:
    """The worst case of a row of an analysis, and what its ends are where units need not reach them."""
    kinds = {"bound": " (bound)", "sample": " (of the units tried)"}
    return range_text(row["worst_case_least"], row["worst_case_greatest"]) + kinds.get(row["worst_case_kind"], "")


@dataclass(frozen=True, slots=True)
class Compared:
    """A run among others: what it is called, its front and its references."""

    label: str
    front: pd.DataFrame
    references: pd.DataFrame


@dataclass(frozen=True, slots=True)
class Comparison:
    """Several runs with the same objectives.

    `table` has one row per run, `equal` the cost of each at levels of the other objective (empty
    where there is no one other objective, or no common level).
    """

    title: str
    objectives: tuple[Axis, ...]
    runs: tuple[Compared, ...]
    table: pd.DataFrame
    equal: pd.DataFrame
    notes: tuple[str, ...] = ()


# A section that a plugin adds to the page of a run: its base class, and those installed.
#
# Plugins import this module: it loads nothing that draws.


class PageSection(ABC):
    """A section of the page of a run, between the choices and the references."""

    title: ClassVar[str]
    """Its heading, plain text."""

    @abstractmethod
    def body(self, result: RunResult) -> str:
        """HTML below the heading, empty where the section has nothing to show for this run.

        Texts from outside are to be escaped (`html.escape`). The page loads nothing from elsewhere
        and runs no script of a section.
        """


SECTIONS: Kinds[PageSection] = Kinds("pages")
"""The sections by name: entry points of `tolevo.pages`."""
