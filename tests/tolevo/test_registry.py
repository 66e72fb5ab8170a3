"""Plugins that are really installed (as far as importlib.metadata can tell) in a scratch folder."""

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.errors import InputError

CASES = Path(__file__).parents[1] / "cases"

ENTRIES = """[tolevo.effects]
seeping = tolevo_fake.inner:Creep
broken = tolevo_fake.broken:Broken
again = tolevo_fake:Creep
lost = tolevo_fake.nowhere:Lost
costly = tolevo_fake.costly:Costly
"""
INNER = """from tolevo.models.effects.effect import Effect
class Creep(Effect):
    '''Slow creep.

    More.
    '''
    name, family, cause = "seeping", "load", "Grease."
    own_parameters = own_action = None
"""
NEEDS = """Requires-Dist: pytest>=1
Requires-Dist: pytest>=1; extra == "heavy"
Requires-Dist: tolevo-none_such.at.all>=1,<2; extra == "heavy"
Requires-Dist: tolevo-other-none; extra == "light"
"""


def install(folder: Path, name: str, version: str, entries: str, needs: str = "") -> None:
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n{needs}"
    (info / "METADATA").write_text(metadata)
    (info / "entry_points.txt").write_text(entries)


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    package = tmp_path / "tolevo_fake"
    package.mkdir()
    (package / "__init__.py").write_text("from .inner import Creep as Creep\n")
    (package / "inner.py").write_text(INNER)
    (package / "broken.py").write_text('"""x"""\nraise RuntimeError("no licence")\n')
    (package / "costly.py").write_text('from .inner import Creep\nclass Costly(Creep):\n    extras = ("heavy",)\n')
    install(tmp_path, "tolevo-fake", "1.2", ENTRIES, NEEDS)
    monkeypatch.syspath_prepend(tmp_path)
    imported = [name for name in sys.modules if name.startswith("tolevo_fake")]
    for name in imported:
        monkeypatch.delitem(sys.modules, name)
    return tmp_path


def entry(name: str) -> dict[str, str]:
    return next(one for one in registry.listing()["effects"] if one["name"] == name)


def test_listing_reads_metadata_and_source_without_importing(plugin: Path) -> None:
    expected = {"description": "Slow creep.", "origin": "tolevo-fake 1.2"}
    assert entry("seeping") == {"name": "seeping", **expected}
    assert entry("again") == {"name": "again", **expected}  # through a re-export
    assert entry("broken")["description"] == entry("lost")["description"] == "(no description)"
    assert not [name for name in sys.modules if name.startswith("tolevo_fake")]


def test_describe_and_origin(plugin: Path) -> None:
    assert registry.describe("effects", "seeping") == "Slow creep."
    assert registry.origin("effects", "seeping") == "tolevo-fake 1.2"


def test_load(plugin: Path) -> None:
    assert registry.load("effects", "seeping").__name__ == "Creep"


def test_unknown_name_gets_the_nearest(plugin: Path) -> None:
    with pytest.raises(InputError, match=r'effect: "seepin" is not .*did you mean `seeping`'):
        registry.load("effects", "seepin")


def test_plugin_that_cannot_be_imported(plugin: Path) -> None:
    with pytest.raises(InputError, match=r"broken.*tolevo-fake 1.2.*RuntimeError: no licence"):
        registry.load("effects", "broken")


def test_missing_extra_is_named_with_its_command(plugin: Path) -> None:
    text = r"\"costly\" needs tolevo-none_such.at.all: pip install 'tolevo-fake\[heavy\]'$"
    with pytest.raises(InputError, match=text):
        registry.load("effects", "costly")


def test_name_offered_twice(plugin: Path) -> None:
    install(plugin, "tolevo-other", "3", "[tolevo.effects]\nseeping = os:path\n")
    assert registry.names("effects").count("seeping") == 1
    with pytest.raises(InputError, match=r"tolevo-fake 1.2 and tolevo-other 3"):
        registry.load("effects", "seeping")


WRONG = """
import os
def function(*arguments, **options):
    open(os.environ["MARK"], "a").write("called")
class Alien:
    __init__ = function
class Meta(type):
    __call__ = function
class Metaclassed(metaclass=Meta):
    pass
class Object:
    __call__ = __getattr__ = function
instance = Object()
number = 3
"""
NAMES = (
    *("os:abort", "builtins:print", "builtins:int", "builtins:object.__subclasses__", "os:path", "sys:exit"),
    *("tolevo_wrong:function", "tolevo_wrong:Alien", "tolevo_wrong:Metaclassed", "tolevo_wrong:instance"),
    *("tolevo_wrong:instance.foo", "tolevo_wrong:number", "tolevo_wrong:nothing", "tolevo_no_such:X"),
    *("tolevo_exits:X", "tolevo_odd:X", "tolevo_asserts:X", "tolevo_syntax:X", "collections.abc:Mapping"),
    *("pymoo.algorithms.moo.nsga2:NSGA2", "pymoo.core.problem:Problem", "tolevo.models.costs:Reciprocal"),
    *("tolevo.models.effects.effect:Effect", "tolevo.algorithms.settings:AlgorithmSettings", "a" * 4000 + ":X"),
)
STACK = """
problem = "stack"
algorithm.name = "NAME"
requirement = { name = "g", unit = "mm", formula = "a - b" }
[[part]]
name = "a"
nominal = 10.0
t_min = 0.01
t_max = 0.1
cost = { model = "reciprocal", a = 1.0, b = 0.1 }
[[part]]
name = "b"
nominal = 10.0
tolerance = 0.1
"""
CLAIM = 'document = "d"\ntitle = "t"\n[[claim]]\nid = "a"\nplace = "p"\nquantity = "q"\nunit = "1"\nprinted = 1.0\n'
PLACES = {
    "algorithm.name": STACK,
    "problem": 'problem = "NAME"\n',
    "model": 'model = "NAME"\n',
    "effect[0].name": 'model = "rv_transmission"\n[[effect]]\nname = "NAME"\nparameters = { a = 1.0 }\n',
    "c.toml: claim[0] (a).reading[0].calculation": f'{CLAIM}[[claim.reading]]\ncalculation = "NAME"\nquantity = "x"\n',
}


@pytest.mark.parametrize("place", PLACES)
def test_a_name_of_the_wrong_kind_is_a_fault_at_its_place_and_is_not_called(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = {"wrong": WRONG, "exits": "raise SystemExit(3)", "odd": "class E(BaseException): pass\nraise E",
             "asserts": "assert False", "syntax": "def ("}  # fmt: skip
    for name, text in texts.items():
        (tmp_path / f"tolevo_{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("MARK", str(tmp_path / "mark"))
    monkeypatch.chdir(tmp_path)
    command = ["reproduce", "c.toml", "--out", "o"] if "claim" in place else ["check", "c.toml"]
    for name in NAMES:
        (tmp_path / "c.toml").write_text(PLACES[place].replace("NAME", name))
        result = CliRunner().invoke(app, command)
        assert (name, result.exit_code) == (name, 2)
        assert f"{place}: " in result.stderr, name
        assert len(result.stderr) < 700
    assert not (tmp_path / "mark").exists()
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("case", "place"),
    [("algorithm_pymoo", "algorithm.name"), ("effect_os_abort", "effect[0].name"), ("model_pymoo", "model")],
)
def test_cases_of_wrong_names(case: str, place: str) -> None:
    result = CliRunner().invoke(app, ["check", str(CASES / "names" / f"{case}.toml")])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"{place}: ")


def test_a_class_that_leaves_out_what_its_kind_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "from tolevo.plugins import AlgorithmSettings, Effect\n"
    text += "class Bare(Effect):\n    own_parameters = own_action = None\n"
    text += "class Plain(AlgorithmSettings):\n    many_objectives = True\n    build = None\n"
    (tmp_path / "tolevo_bare.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match="does not state name, family, cause"):
        registry.load("effects", "tolevo_bare:Bare")
    with pytest.raises(InputError, match="must be a dataclass"):
        registry.load("algorithms", "tolevo_bare:Plain")
