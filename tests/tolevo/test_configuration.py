"""Configurations: what they come to, and every fault at its place."""

import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tolevo
from tolevo import registry
from tolevo.configuration.configuration import Configuration
from tolevo.configuration.reader import read, read_table
from tolevo.errors import InputError, refuse
from tolevo.models.costs import Exponential, Reciprocal, Table
from tolevo.models.inputs import Normal
from tolevo.models.measurable import MeasurableModel
from tolevo.problems.declaration import Declaration
from tolevo.problems.settings import Bound
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.section import Array, Kind, Output, Parameter, Variable


class Bracket(ToleranceProblem):
    """A stand-in with one of everything that a configuration can state."""

    declaration = Declaration(
        parameters=(
            Parameter("arm_mm", 12.5, "mm", "arm", low=0.0, open_low=True),
            Parameter("pins", 40, "", "number of pins", low=1),
            Parameter("lubricated", True, "", "whether there is oil"),
            Parameter("reading", "printed", "", "which table", choices=("printed", "consistent")),
            Parameter("bore_mid_um", 0.0, "um", "mid-limit of the bore"),
        ),
        variables=(
            Variable("bore_um", "um", Kind.HALF_WIDTH, 1.0, 10.0, "bore", 2.0, 0.0, valid_low=0.0, random=True),
            Variable("bearing_um", "um", Kind.FULL_CLEARANCE, 1.0, 20.0, "play", 2.0, valid_low=0.0, random=True),
            Variable("grade", "", Kind.GRADE, 4, 8, "ISO grade", 7, integer=True, valid_low=1, valid_high=12),
            Variable("stagger_arcmin", "arcmin", Kind.NOMINAL, 0.0, 1.0, "stagger", 0.0),
        ),
        outputs=(
            Output("cost", "", "cost", low=0.0),
            Output("play_arcmin", "arcmin", "play", low=0.0),
            Output("yield_percent", "percent", "yield", 100.0, larger_is_better=True, low=0.0, high=100.0),
            Output("play_arcmin_error", "arcmin", "error", error_of="play_arcmin"),
        ),
        costs={
            "bore_um": Reciprocal(1.0, 2.0),
            "bearing_um": Exponential(1.0, 2.0, 0.5),
            "grade": Table((4.0, 8.0), (3.0, 1.0)),
        },
        limits={"play_arcmin": Bound(high=90.0)},
        objectives=("cost", "play_arcmin"),
        model="bracket_batch",
    )

    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        play = designs[:, 0] + designs[:, 1]
        rest = {"yield_percent": 0.0 * play, "play_arcmin_error": 0.0 * play}
        return {"cost": self.cost_of(designs), "play_arcmin": play} | rest


class BracketModel(MeasurableModel):
    columns = ()
    outputs = Bracket.declaration.outputs[1:2]
    changeable = ()
    population = False
    parameters = Bracket.declaration.parameters
    variables = Bracket.declaration.variables


Read = Callable[..., Configuration]


@pytest.fixture
def read_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    real = registry.load

    def load(group: str, name: str) -> Any:
        stand_ins = {("problems", "bracket"): Bracket, ("models", "bracket_batch"): BracketModel}
        if (group, name) in stand_ins:
            return stand_ins[group, name]
        if group == "problems":
            raise refuse(group, f'"{name}" is not known')
        return real(group, name)

    monkeypatch.setattr(registry, "load", load)

    def read_it(text: str, *overrides: str) -> Configuration:
        path = tmp_path / "c.toml"
        path.write_text(text, encoding="utf-8")
        return read(path, overrides)

    return read_it


def faults_of(action: Callable[[], object]) -> list[str]:
    with pytest.raises(InputError) as caught:
        action()
    return [str(fault) for fault in caught.value.faults]


BASE = 'problem = "bracket"\n'
FULL = """
problem = "bracket"
seed = 3
references = "none"
[parameters]
arm = "1.3 cm"
reading = "consistent"
[variables.bore_um]
low = "0.001 mm"
high = 9
distribution = "normal"
cp = 1.33
shift = -0.1
mid = 2
[variables.grade]
value = 6
[costs.bore_um]
model = "reciprocal_power"
a = 1
b = 2.5
k = 0.6
[propagation]
method = "moments"
coverage = 0.99
[limits]
yield_percent = 50
play_arcmin = { min = 1, max = "1 deg" }
stagger_arcmin = 0.5
[algorithm]
name = "nsga2"
engine = "pymoo"
population = 40
evaluations = 1000
points = 500
[algorithm.mutation]
probability = 0.2
"""


def test_what_is_set_arrives_in_the_unit_of_its_name(read_text: Read) -> None:
    found = read_text(FULL)
    settings = found.settings
    assert (found.seed, found.references, found.problem_name) == (3, "none", "bracket")
    assert settings.parameters["arm_mm"] == pytest.approx(13.0)
    assert settings.parameters["bore_mid_um"] == 2.0
    bore = settings.variables["bore_um"]
    assert bore.low == pytest.approx(1.0)
    assert (bore.high, bore.mid) == (9.0, 2.0)
    assert bore.distribution == Normal(1.33, -0.1)
    assert settings.variables["grade"].value == 6
    assert settings.limits["yield_percent"] == Bound(low=50.0)
    assert settings.limits["play_arcmin"].high == pytest.approx(60.0)
    assert settings.limits["stagger_arcmin"] == Bound(high=0.5)
    assert found.budget.evaluations == 1000
    assert found.budget.generations is None
    algorithm: Any = found.algorithm
    assert (algorithm.population, algorithm.mutation.probability) == (40, 0.2)
    assert algorithm.crossover.probability == 0.9


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({}, "exact"),
        ({"points": 12}, "exact"),
        ({"evaluations": 500}, "exact"),
        ({"population": 40}, "nsga2"),
        ({"generations": 40}, "nsga2"),
        ({"engine": "array"}, "nsga2"),
        ({"polish": True}, "nsga2"),
        ({"name": "hybrid", "population": 40}, "hybrid"),
    ],
)
def test_default_algorithm_is_the_one_whose_keys_are_set(given: dict[str, Any], name: str) -> None:
    """Of `rv_backlash` it is exact, unless a key of the evolutionary ones stands there."""
    limits = {"interference_probability": 0.05}
    table = {"problem": "rv_backlash", "limits": limits, "algorithm": given}
    assert read_table(table, []).algorithm_name == name


def test_default_algorithm_of_one_objective_with_a_population_is_the_ga() -> None:
    limits = {"interference_probability": 0.05, "backlash_arcmin": 1.0}
    table = {"problem": "rv_backlash", "limits": limits, "algorithm": {"population": 20},
             "objectives": {"minimise": ["cost"]}}  # fmt: skip
    assert read_table(table, []).algorithm_name == "ga"


@pytest.mark.parametrize("text", [BASE, FULL, 'model = "bracket_batch"\n'])
def test_the_resolved_configuration_is_a_fixpoint(read_text: Read, text: str) -> None:
    once = read_text(text)
    again = read_text(once.toml())
    assert again.resolved == once.resolved == tomllib.loads(once.toml())
    assert again.hash == once.hash


def test_the_resolved_configuration_holds_every_value(read_text: Read) -> None:
    found = read_text(BASE).resolved
    assert found["seed"] == 0
    assert set(found["parameters"]) == {p.name for p in Bracket.declaration.parameters}
    assert found["variables"]["bore_um"] == {
        "low": 1.0, "high": 10.0, "mid": 0.0, "distribution": "uniform",
    }  # fmt: skip
    assert found["variables"]["grade"] == {"low": 4, "high": 8}
    assert set(found["costs"]) == set(Bracket.declaration.costs)
    assert found["limits"] == {"play_arcmin": {"max": 90.0}}
    assert found["algorithm"]["name"] == "nsga2"
    assert found["algorithm"]["generations"] == 200


def test_one_objective_takes_the_ga_by_default(read_text: Read) -> None:
    assert read_text(BASE, 'objectives.minimise=["cost"]').algorithm_name == "ga"


FAULTS = {
    "seeed = 1": "seeed: is not a known key (did you mean `seed`?)",
    "seed = -1": "seed: must be at least 0, got -1",
    "seed = true": "seed: must be a whole number, got true",
    "seed = 1.0": "seed: must be a whole number, got 1.0",
    'references = "paper"': 'references: must be one of documents, ga, none, got "paper"',
    "parameters.arn_mm = 1": "parameters.arn_mm: is not a known key (did you mean `arm_mm`?)",
    'parameters.arm = "1 kg"': 'parameters.arm: must be a number or a string with a unit of mm, '
                               'got "1 kg"',
    "parameters.arm = 1": 'parameters.arm: needs a unit: write arm = "... mm", or arm_mm',
    "parameters.arm_mm = nan": "parameters.arm_mm: must be finite, got nan",
    "parameters.arm_mm = 0": "parameters.arm_mm: must be above 0, got 0",
    "parameters.pins = 4.5": "parameters.pins: must be a whole number, got 4.5",
    "parameters.lubricated = 1": "parameters.lubricated: must be true or false, got 1",
    'parameters.reading = "printd"': 'parameters.reading: must be one of printed, consistent, '
                                     'got "printd" (did you mean `printed`?)',
    "parameters = 1": "parameters: must be a table, got 1",
    "variables.bor_um.value = 1": "variables.bor_um: is not a known key (did you mean `bore_um`?)",
    "variables.bore_um.low = 12": "variables.bore_um.low: must be below high (10), got 12",
    "variables.bore_um.low = 10": "variables.bore_um.low: must be below high (10), got 10; a variable that is not "
                                  "searched has value = 10",
    "variables.bore_um = { value = 1, low = 2 }":
        "variables.bore_um: give either value or low and high, not both",
    "variables.bore_um.low = 0": "variables.bore_um.low: must have a finite cost, but 0 um costs "
                                 "inf by its cost curve (reciprocal)",
    "variables.bore_um.low = -1": "variables.bore_um.low: must be at least 0, got -1",
    "variables.bore_um.high = inf": "variables.bore_um.high: must be finite, got inf",
    "variables.bore_um.value = true": "variables.bore_um.value: must be a number or a string with "
                                      "a unit of um, got true",
    "variables.bore_um.cp = 1": "variables.bore_um.cp: needs a distribution that takes it: set "
        'distribution = "exponential" or "lognormal" or "normal" or "rayleigh" or "skew_normal" or "truncated_normal"',
    'variables.bore_um = { distribution = "normal", cp = 0 }':
        "variables.bore_um.cp: must be above 0, got 0",
    'variables.bore_um = { distribution = "normal", shift = 2 }':
        "variables.bore_um.shift: must lie in [-1, 1], got 2",
    'variables.bore_um.limits = "2"':
        'variables.bore_um.limits: write limits as "+0.02/-0.01" (upper/lower), got "2"',
    'variables.bore_um = { limits = "+2/-4", value = 1 }':
        "variables.bore_um.limits: set value and mid: leave out value",
    'variables.bearing_um.limits = "+2/-4"': "variables.bearing_um.limits: do not apply to a full "
                                             "clearance c of the zone [0, c]: give value",
    "variables.bearing_um.mid = 1": "variables.bearing_um.mid: bearing_um (full clearance c of the "
                                    "zone [0, c]) has no mid-limit",
    "variables.grade.low = 4.5": "variables.grade.low: must be a whole number, got 4.5",
    "variables.grade.high = 13": "variables.grade.high: must lie in [1, 12], got 13",
    "variables.grade.value = 9": "variables.grade.value: must have a finite cost, but 9  costs inf "
                                 "by its cost curve (table)",
    'variables.grade.distribution = "normal"':
        "variables.grade.distribution: grade (tolerance grade) has no distribution to set",
    'costs.bore_um.model = "linear"': "costs.bore_um.model: must be one of combined, "
        'exponential, reciprocal, reciprocal_power, reciprocal_squared, table, got "linear"',
    'costs.bore_um = { model = "reciprocal", a = 1 }':
        "costs.bore_um.b: is missing: the cost model reciprocal needs a, b",
    "costs.bore_um.b = -1": "costs.bore_um.b: must not be negative (the cost would rise with the "
                            "tolerance), got -1",
    "costs.grade.cost_at = [1, true]": "costs.grade.cost_at[1]: must be a number, got true",
    "costs.stagger_arcmin.a = 1": "costs.stagger_arcmin: is not a known key",
    'propagation.method = "fft"':
        'propagation.method: must be one of moments, convolution, monte_carlo, got "fft"',
    "propagation.coverage = 1": "propagation.coverage: must lie in (0, 1), got 1",
    "propagation.samples = 0": "propagation.samples: must lie in [2, 67108864], got 0",
    'objectives.minimise = ["cost", "plai_arcmin"]': 'objectives.minimise: "plai_arcmin" is not '
        "an output (did you mean `play_arcmin`?); one of cost, play_arcmin",
    'objectives.minimise = ["cost", "cost"]': 'objectives.minimise: "cost" is named twice',
    'objectives.minimise = "cost"': 'objectives.minimise: must be a list of strings, got "cost"',
    "objectives.minimise = []": "objectives.minimise: must name at least one",
    'objectives.minimise = ["cost", "yield_percent"]':
        'objectives.minimise: "yield_percent" is better when larger: limit it instead',
    'objectives.minimise = ["cost", "play_arcmin_error"]': "objectives.minimise: "
        '"play_arcmin_error" is the error of play_arcmin, not a property of the design',
    "limits.play_arcmin = -1": "limits.play_arcmin: must be at least 0, got -1",
    "limits.yield_percent = 101": "limits.yield_percent: must lie in [0, 100], got 101",
    "limits.play_arcmin = { min = 2, max = 1 }":
        "limits.play_arcmin.min: must not be above max (1), got 2",
    "limits.play_arcmin = {}": "limits.play_arcmin: needs min, max or both",
    "limits.play_arcmin_error = 1":
        "limits.play_arcmin_error: is the error of play_arcmin and cannot be limited",
    "algorithm.mutation.probability = 1.3":
        "algorithm.mutation.probability: must lie in [0, 1], got 1.3",
    "algorithm.population = 0": "algorithm.population: must be at least 2, got 0",
    "algorithm.generations = 0": "algorithm.generations: must be at least 1, got 0",
    "algorithm.time_limit_s = 0": "algorithm.time_limit_s: must be above 0, got 0",
    'algorithm.engine = "arrray"':
        'algorithm.engine: must be one of pymoo, array, got "arrray" (did you mean `array`?)',
    'algorithm.name = "random"\nalgorithm.engine = "array"':
        'algorithm.engine: random has no array engine: choose one of gde3, nsga2, or engine = "pymoo"',
    "algorithm.mutatoin.probability = 1":
        "algorithm.mutatoin: is not a known key (did you mean `mutation`?)",
    'algorithm.name = "cmopso"':
        "algorithm.name: cmopso of pymoo is not offered: its survival draws from a generator "
        "without a seed, so that no run can be repeated; use gde3",
    'algorithm.name = "nsga3"\nalgorithm.partitions = 100':
        "algorithm.partitions: 100 partitions of 2 axes give 101 reference directions, more than the "
        "population of 100: raise population to 101, or give fewer partitions (0: as many as the "
        "population holds)",
    'algorithm.name = "ga"': "algorithm.name: ga takes exactly one objective, [objectives] "
                             "minimise names 2",
    "[[effect]]\nname = 'wear'": 'effect[0].name: "wear" has no place in the model bracket_batch: '
                                 "no column of the role direction",
}  # fmt: skip


@pytest.mark.parametrize("line", FAULTS)
def test_a_fault_is_reported_at_its_place(read_text: Read, line: str) -> None:
    assert faults_of(lambda: read_text(BASE + line)) == [FAULTS[line]]


def test_every_fault_is_reported_at_once(read_text: Read) -> None:
    lines = [line for line in FAULTS if "." in line.split("=")[0] and not {"{", "\n"} & set(line)]
    one_each = {line.split("=")[0].rsplit(".", 1)[0]: line for line in lines if "[" not in line}
    found = faults_of(lambda: read_text(BASE + "\n".join(one_each.values())))
    assert set(found) >= {FAULTS[line] for line in one_each.values()}


def test_a_mid_limit_may_be_given_in_one_place_only(read_text: Read) -> None:
    text = BASE + "parameters.bore_mid_um = 1\nvariables.bore_um.mid = 2"
    assert faults_of(lambda: read_text(text)) == [
        "variables.bore_um.mid: differs from parameters.bore_mid_um: 2 here, 1 there"
    ]
    found = read_text(BASE + "parameters.bore_mid_um = 1")
    assert found.settings.variables["bore_um"].mid == 1.0


def test_limits_of_a_drawing_set_value_and_mid(read_text: Read) -> None:
    bore = read_text(BASE + 'variables.bore_um.limits = "+2/-4"').settings.variables["bore_um"]
    assert (bore.value, bore.mid) == (3.0, -1.0)


def test_a_curve_without_model_changes_the_default(read_text: Read) -> None:
    costs = read_text(BASE + "costs.bore_um.b = 5").settings.costs
    assert costs["bore_um"] == Reciprocal(1.0, 5.0)


def test_a_limit_no_design_can_meet_is_a_fault(read_text: Read) -> None:
    text = BASE + "limits.stagger_arcmin = { min = 2 }"
    assert faults_of(lambda: read_text(text))[0].startswith("limits.stagger_arcmin")


def test_overrides_are_checked_like_the_file(read_text: Read) -> None:
    found = read_text(FULL, "seed=0", "variables.bore_um.value=2 um", "references=documents")
    assert (found.seed, found.references) == (0, "documents")
    assert found.settings.variables["bore_um"].value == 2.0
    assert faults_of(lambda: read_text(BASE, "seed", "=1", "problem.x=1", "sed=2")) == [
        '--set: must be key=value, got "seed"',
        '--set: must be key=value, got "=1"',
        "--set problem.x: leads through a value that is not a table",
        "sed: is not a known key (did you mean `seed`?)",
    ]


def test_a_model_alone(read_text: Read) -> None:
    found = read_text('model = "bracket_batch"\nvariables.bore_um.value = 3')
    assert found.problem is None
    assert found.settings.variables["bore_um"].value == 3.0
    assert found.settings.variables["bearing_um"].value == 2.0
    text = 'model = "bracket_batch"\n[variables.bore_um]\nlow = 1\n[limits]\ncost = 1'
    assert faults_of(lambda: read_text(text)) == [
        "limits: needs a problem: a model alone takes seed, parameters and variables",
        "variables.bore_um: a model needs a value, not a range",
    ]


def test_a_configuration_names_a_problem_or_a_model(read_text: Read) -> None:
    assert faults_of(lambda: read_text("seed = 1"))[0].startswith("problem: is missing")
    assert faults_of(lambda: read_text('problem = "x"\nsed = 1')) == [
        'problem: "x" is not known',
        "sed: is not a known key (did you mean `seed`?)",
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"  \n", "is empty"),
        (b"\xff\xfe", "is not UTF-8 (byte 0)"),
        (b"seed = 1\nproblem = ", "is not valid TOML: Invalid value (at"),
    ],
)
def test_a_file_that_is_no_configuration(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "c.toml"
    path.write_bytes(content)
    assert message in faults_of(lambda: read(path))[0]


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    assert "is a directory" in faults_of(lambda: read(tmp_path))[0]
    assert "does not exist" in faults_of(lambda: read(tmp_path / "none.toml"))[0]


def test_a_seed_may_be_large(read_text: Read) -> None:
    assert read_text(BASE + f"seed = {2**62}").seed == 2**62


def test_costs_of_the_stand_in_are_finite() -> None:
    assert np.isfinite(Bracket()._cost_interval).all()


def test_the_engine_is_read_and_written(read_text: Read) -> None:
    found = read_text(BASE + 'algorithm.engine = "array"')
    assert found.engine == found.resolved["algorithm"]["engine"] == "array"
    assert read_text(found.toml()).toml() == found.toml()
    assert read_text(BASE).resolved["algorithm"]["engine"] == "pymoo"


def test_gde3_has_settings_of_its_own(read_text: Read) -> None:
    found = read_text(BASE + 'algorithm.name = "gde3"\nalgorithm.crossover.probability = 0.8')
    assert found.resolved["algorithm"]["crossover"] == {"probability": 0.8}
    assert found.resolved["algorithm"]["mutation"] == {"low": 0.0, "high": 1.0}
    text = BASE + 'algorithm.name = "gde3"\nalgorithm.population = 3'
    assert faults_of(lambda: read_text(text)) == ["algorithm.population: must be at least 4, got 3"]


PART = '[[part]]\nname = "p{}"\nnominal = 10.0\nt_min = 0.01\nt_max = 0.1\n'
STACKED = 'problem = "stack"\nrequirement = { name = "g", unit = "mm", formula = "a - b" }\n'
SIZES = {
    "many parts": (STACKED + "".join(map(PART.format, range(20_000))), "c.toml: has about 20001 tables"),
    "a list of parts": (STACKED + "".join(map(PART.format, range(3000))), "part: has 3000 entries, 2000 are the most"),
    "many keys": (STACKED + "".join(f"k{at} = 1\n" for at in range(50_000)), "configuration: has 50002 keys"),
    "a long text": (STACKED.replace("mm", "u" * 10**6), "requirement.unit: has 1000000 characters"),
    "a long unit": (STACKED.replace("mm", "u" * 30_000), 'requirement.unit: "uuu'),
    "a long key": (f"{STACKED}{'k' * 10**6} = 1\n", "configuration: has a key of more than 2000 characters"),
    "a long name": (f"{STACKED}{'x.' * 30_000}a = 1\n", "c.toml: line 3: a name has more than 64 parts"),
    "a long file": (f"{STACKED}# {'c' * 9_000_000}\n", "c.toml: has 8.58 MiB or more, and 8 MiB is the most"),
    "a huge number": (f"{STACKED}seed = {'9' * 10**6}\n", "c.toml: is not valid TOML: Exceeds the limit"),
    "deep": (f"{STACKED}limits.variation = {'[' * 10**5}\n", "c.toml: has about 50001 tables"),
    "many names": (f"{STACKED}objectives.minimise = {['x'] * 10**5}\n", "objectives.minimise: has 100000 names"),
}


@pytest.mark.parametrize("case", SIZES)
def test_a_configuration_has_stated_sizes_and_is_refused_at_once(case: str, tmp_path: Path) -> None:
    text, said = SIZES[case]
    (tmp_path / "c.toml").write_text(text)
    begin = time.process_time()
    with pytest.raises(InputError) as caught:
        tolevo.check(tmp_path / "c.toml")
    assert time.process_time() - begin < 2.0
    lines = str(caught.value).replace(f"{tmp_path}/", "").splitlines()
    assert any(line.startswith(said) for line in lines)
    assert all(len(line) < 400 for line in lines)


def test_a_fault_that_repeats_is_one_line(tmp_path: Path) -> None:
    parts = "".join(map((PART + 'cost = {{ model = "reciprocal", a = 1.0, b = 0.1 }}\n').format, range(38)))
    formula = " + ".join(f"p{at}" for at in range(38))
    (tmp_path / "c.toml").write_text(STACKED.replace("a - b", formula) + parts.replace("0.01", "-0.01"))
    with pytest.raises(InputError) as caught:
        tolevo.check(tmp_path / "c.toml")
    assert len(caught.value.faults) == 38
    (line,) = str(caught.value).splitlines()
    assert line.startswith("part[0].t_min, part[1].t_min, part[2].t_min and 35 other places: must be above 0")


def test_a_file_of_claims_names_the_command_that_takes_it(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('document = "d"\ntitle = "t"\n[[claim]]\nid = "a"\n')
    with pytest.raises(InputError, match=r"^claim: makes this a file of claims: give it to `tolevo reproduce`"):
        tolevo.check(tmp_path / "c.toml")
