"""Distributions in a configuration: what is read, what is written back, and every fault."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from tolevo.configuration.configuration import Configuration
from tolevo.configuration.reader import read
from tolevo.errors import Fault, InputError
from tolevo.models.input_reading import keys, name_of, read_distribution, written
from tolevo.models.inputs import (
    DISTRIBUTIONS,
    Beta,
    Distribution,
    Empirical,
    Exponential,
    LogNormal,
    Mixture,
    Normal,
    Rayleigh,
    SkewNormal,
    Trapezoid,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from tolevo.section import Section

STATED: dict[str, Distribution] = {
    'distribution = "uniform"': Uniform(),
    'distribution = "triangular"': Triangular(0.0),
    'distribution = "triangular"\nmode = -1': Triangular(-1.0),
    'distribution = "trapezoid"\ntop = 0.25': Trapezoid(0.25),
    'distribution = "beta"\nalpha = 0.5\nbeta = 3': Beta(0.5, 3.0),
    'distribution = "normal"': Normal(1.0, 0.0),
    'distribution = "normal"\ncp = 1.5\nshift = -0.1': Normal(1.5, -0.1),
    'distribution = "normal"\ncp = 2\ncpk = 1.5': Normal(2.0, 0.25),
    'distribution = "normal"\ncpk = 0.75': Normal(1.0, 0.25),
    'distribution = "normal"\ncp = 1.33\ncpk = 1.33': Normal(1.33, 0.0),
    'distribution = "truncated_normal"\ncp = 0.5\ncpk = 0': TruncatedNormal(0.5, 1.0),
    'distribution = "skew_normal"\nskew = -4\ncp = 2\ncpk = 1': SkewNormal(-4.0, 2.0, 0.5),
    'distribution = "rayleigh"\ncp = 1.33': Rayleigh(1.33),
    'distribution = "exponential"': Exponential(),
    'distribution = "lognormal"\nshape = 0.4\ncp = 1.2': LogNormal(0.4, 1.2),
    'distribution = "empirical"\nvalues = [0.5, -1, 0.5]': Empirical((0.5, -1.0, 0.5)),
    'distribution = "mixture"\ncentres = [-0.5, 0.2]\nspreads = [0.1, 0.2]': Mixture((-0.5, 0.2), (0.1, 0.2)),
    'distribution = "mixture"\ncentres = [0, 1]\nspreads = [0.1, 0.1]\nshares = [3, 1]': Mixture(
        (0.0, 1.0), (0.1, 0.1), (3.0, 1.0)
    ),
}


def taken(text: str, default: Distribution | None = None) -> tuple[Distribution | None, list[str]]:
    """What a table states, and its faults; keys that nobody asked for are faults as well."""
    faults: list[Fault] = []
    section = Section(tomllib.loads(text), "part", faults)
    found = read_distribution(section, default)
    section.finish()
    return found, [str(fault) for fault in faults]


@pytest.mark.parametrize("text", STATED)
def test_what_is_stated_is_read(text: str) -> None:
    assert taken(text) == (STATED[text], [])


def test_every_distribution_is_tried() -> None:
    assert {type(case) for case in STATED.values()} == set(DISTRIBUTIONS.values())


@pytest.mark.parametrize("text", STATED)
def test_what_is_written_reads_back(text: str) -> None:
    table = tomli_w.dumps(written(STATED[text]))
    found, faults = taken(table)
    assert (found, faults) == (STATED[text], [])
    assert found is not None
    assert tomli_w.dumps(written(found)) == table


@given(st.floats(0.01, 10.0), st.floats(0.0, 1.0))
def test_cpk_comes_out_as_it_went_in(cp: float, share: float) -> None:
    found, faults = taken(f'distribution = "normal"\ncp = {cp!r}\ncpk = {share * cp!r}')
    assert faults == []
    assert isinstance(found, Normal)
    assert found.shift >= 0.0
    assert found.cp * (1.0 - abs(found.shift)) == pytest.approx(share * cp, abs=1e-14 * cp)
    assert taken(tomli_w.dumps(written(found))) == (found, [])


def test_nothing_stated_is_the_default() -> None:
    assert taken("") == (None, [])
    assert taken("", Normal(1.5, 0.2)) == (Normal(1.5, 0.2), [])


def test_keys_without_a_distribution_change_the_default() -> None:
    default = Normal(1.5, 0.2)
    assert taken("cp = 2", default) == (Normal(2.0, 0.2), [])
    assert taken("cpk = 1.2", default)[0] == Normal(1.5, 1.0 - 1.2 / 1.5)
    assert taken("cpk = 1.67", default)[0] == Normal(1.67, 0.0)  # a Cpk alone, above the usual Cp
    assert taken("skew = 3", SkewNormal(1.0, 2.0, 0.1)) == (SkewNormal(3.0, 2.0, 0.1), [])
    assert taken('distribution = "normal"', default) == (Normal(), [])
    assert taken("values = [0, 1]", Empirical((3.0, 4.0))) == (Empirical((0.0, 1.0)), [])


SHIFTED = 'set distribution = "normal" or "skew_normal" or "truncated_normal"'
EQUATION = "since Cpk = Cp (1 - |shift|)"
FAULTS: dict[str, list[str]] = {
    'distribution = "gauss"': ["distribution: must be one of " + ", ".join(DISTRIBUTIONS)
                               + ', got "gauss"'],
    'distribution = "betta"\ncp = 0': [
        f'distribution: must be one of {", ".join(DISTRIBUTIONS)}, got "betta" (did you mean '
        "`beta`?)", "cp: must be above 0, got 0"],
    "distribution = 1": ["distribution: must be a string, got 1"],
    "cp = 1": ['cp: needs a distribution that takes it: set distribution = "exponential" or "lognormal" or '
               '"normal" or "rayleigh" or "skew_normal" or "truncated_normal"'],
    "cpk = 1\ntop = 2": ["top: must lie in [0, 1], got 2",
        'top: needs a distribution that takes it: set distribution = "trapezoid"',
        f"cpk: needs a distribution that takes it: {SHIFTED}"],
    'distribution = "uniform"\nshift = 0.1': [f"shift: does not apply to uniform: {SHIFTED}"],
    'distribution = "uniform"\ncpk = 1': [f"cpk: does not apply to uniform: {SHIFTED}"],
    'distribution = "rayleigh"\ncpk = 1\ncp = 1':
        [f"cpk: does not apply to rayleigh: {SHIFTED}"],
    'distribution = "normal"\nalpha = -1\nbeta = 2': ["alpha: must be above 0, got -1",
        'alpha: does not apply to normal: set distribution = "beta"',
        'beta: does not apply to normal: set distribution = "beta"'],
    'distribution = "triangular"\nmode = 1.5': ["mode: must lie in [-1, 1], got 1.5"],
    'distribution = "trapezoid"\ntop = -0.5': ["top: must lie in [0, 1], got -0.5"],
    'distribution = "trapezoid"\ntop = "all"': ['top: must be a number, got "all"'],
    'distribution = "beta"': ["alpha: is missing: beta needs alpha and beta",
                              "beta: is missing: beta needs alpha and beta"],
    'distribution = "beta"\nalpha = 0\nbeta = -1': ["alpha: must be above 0, got 0",
                                                    "beta: must be above 0, got -1"],
    'distribution = "beta"\nalpha = inf\nbeta = 1': ["alpha: must be finite, got inf"],
    'distribution = "skew_normal"\ncp = 1':
        ["skew: is missing: skew_normal needs skew"],
    'distribution = "skew_normal"\nskew = 1e4\nshift = 2': [
        "shift: must lie in [-1, 1], got 2", "skew: must lie in [-1000, 1000], got 10000"],
    'distribution = "rayleigh"\ncp = 0': ["cp: must be above 0, got 0"],
    'distribution = "empirical"': ["values: is missing: empirical needs values"],
    'distribution = "empirical"\nvalues = 1': ["values: must be a list of numbers, got 1"],
    'distribution = "empirical"\nvalues = [1, "a", nan]': [
        'values[1]: must be a number, got "a"', "values[2]: must be finite, got nan"],
    'distribution = "empirical"\nvalues = [1, 1.0]':
        ["values: need at least two distinct deviations, in half-widths"],
    'distribution = "empirical"\nvalues = [0, 1e7]':
        ["values: must lie in [-1000000, 1000000], got 10000000"],
    'distribution = "normal"\ncp = 1\ncpk = 1.2':
        [f"cpk: must not be above cp (1), got 1.2: raise cp, {EQUATION}"],
    'distribution = "skew_normal"\nskew = 1\ncp = 1.5\ncpk = 1.6':
        [f"cpk: must not be above cp (1.5), got 1.6: raise cp, {EQUATION}"],
    'distribution = "truncated_normal"\ncpk = 1\nshift = 0':
        [f"cpk: is given together with shift: leave one of them out, {EQUATION}"],
    'distribution = "normal"\ncpk = -0.1': ["cpk: must be at least 0, got -0.1"],
    'distribution = "normal"\ncpk = 1\ncp = -1': ["cp: must be above 0, got -1"],
    'distribution = "normal"\nmodee = 1': ["modee: is not a known key (did you mean `mode`?)"],
}  # fmt: skip


@pytest.mark.parametrize("text", FAULTS)
def test_every_fault_at_its_key(text: str) -> None:
    found, faults = taken(text)
    assert faults == [f"part.{fault}" for fault in FAULTS[text]]
    assert found is None or "modee" in text


def test_every_key_is_known_without_being_stated() -> None:
    assert keys()[0] == "distribution"
    assert set(keys()) == {"distribution", "mode", "top", "alpha", "beta", "cp", "cpk", "shift",
                         "skew", "shape", "values", "centres", "spreads", "shares"}  # fmt: skip
    assert [name_of(kind) for kind in DISTRIBUTIONS.values()] == list(DISTRIBUTIONS)


Read = Callable[[str], Configuration]
BASE = 'problem = "rv_backlash"\n'


@pytest.fixture
def read_text(tmp_path: Path) -> Read:
    def read_it(text: str) -> Configuration:
        path = tmp_path / "c.toml"
        path.write_text(text, encoding="utf-8")
        return read(path)

    return read_it


@pytest.mark.parametrize("text", STATED)
def test_a_configuration_resolves_to_itself(read_text: Read, text: str) -> None:
    found = read_text(f"{BASE}[variables.eccentricity_um]\n{text}")
    assert found.settings.variables["eccentricity_um"].distribution == STATED[text]
    again = read_text(found.toml())
    assert again.settings.variables == {
        name: replace(setting, distribution=setting.distribution or Uniform())
        if "distribution" in found.resolved["variables"][name]
        else setting
        for name, setting in found.settings.variables.items()
    }
    assert again.toml() == found.toml()


@pytest.mark.parametrize("nine", [slice(0, 9), slice(-9, None)])
def test_every_distribution_in_one_problem(read_text: Read, nine: slice) -> None:
    """The document's allocation by convolution and by Monte Carlo, to four standard errors."""
    names = ("pin_circle_radius_um", "pin_position_um", "pin_hole_radius_um", "pin_radius_um",
             "pitch_um", "runout_um", "eccentricity_um", "equidistance_um", "shift_um")  # fmt: skip
    chosen = {name_of(type(case)): text for text, case in STATED.items()}
    del chosen["uniform"]  # nine variables; the mixture has the same moments to be got right and more
    laws = list(chosen.values())[nine]
    tables = [f"[variables.{n}]\n{text}\n" for n, text in zip(names, laws, strict=True)]
    methods = ("convolution", "monte_carlo")
    rows = []
    for method in methods:
        text = f'{BASE}propagation.method = "{method}"\n{"".join(tables)}'
        problem = read_text(text).problem
        assert problem is not None
        rows.append(problem.frame(np.stack(list(problem.references().values()))).iloc[0])
    exact, sampled = rows
    for output in ("backlash_mean_arcmin", "backlash_std_arcmin", "backlash_arcmin"):
        slack = 4.0 * sampled[f"{output}_error"] + exact[f"{output}_error"]
        assert slack < 0.05  # of 1.5 arcmin
        assert exact[output] == pytest.approx(sampled[output], abs=slack)


def faults_of(action: Callable[[], object]) -> list[str]:
    with pytest.raises(InputError) as caught:
        action()
    return [str(fault) for fault in caught.value.faults]


def test_a_radius_needs_a_half_width(read_text: Read) -> None:
    text = '[variables.crank_bearing_um]\ndistribution = "rayleigh"'
    assert faults_of(lambda: read_text(BASE + text)) == [
        "variables.crank_bearing_um.distribution: is a radius, from mid to mid + t: it does not "
        "apply to a full clearance c of the zone [0, c]"
    ]
    text = '[variables.runout_um]\ndistribution = "rayleigh"\nlimits = "+2/0"'
    assert faults_of(lambda: read_text(BASE + text)) == [
        "variables.runout_um.limits: do not apply: the input is a radius, from mid to mid + t. Give value and mid"
    ]


def test_a_nominal_value_has_no_distribution(read_text: Read) -> None:
    text = "[variables.stagger_arcmin]\nvalues = [1]\ncpk = 1"
    nominal = "stagger_arcmin (nominal value) has no distribution to set"
    assert faults_of(lambda: read_text(BASE + text)) == [
        f"variables.stagger_arcmin.values: {nominal}",
        f"variables.stagger_arcmin.cpk: {nominal}",
    ]


def test_faults_of_several_variables_come_at_once(read_text: Read) -> None:
    text = """
[variables.runout_um]
distribution = "beta"
alpha = 0
[variables.shift_um]
distribution = "normal"
cp = 1
cpk = 3
[variables.pitch_um]
values = [1]
"""
    places = [fault.split(":")[0] for fault in faults_of(lambda: read_text(BASE + text))]
    assert sorted(places) == ["variables.pitch_um.values", "variables.runout_um.alpha",
                              "variables.runout_um.beta", "variables.shift_um.cpk"]  # fmt: skip
