"""Plugins that are really installed (as far as importlib.metadata can tell) in a scratch folder."""

import sys
from pathlib import Path

import pytest

from tolevo import registry
from tolevo.errors import InputError

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


def test_age_moea2_needs_the_extra_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    assert registry.load("algorithms", "age_moea2").extras == ("fast",)
    monkeypatch.setattr(registry, "_installed", lambda name: name != "numba")
    with pytest.raises(InputError, match=r"needs numba: pip install 'tolevo\[fast\]'$"):
        registry.load("algorithms", "age_moea2")


def test_name_offered_twice(plugin: Path) -> None:
    install(plugin, "tolevo-other", "3", "[tolevo.effects]\nseeping = os:path\n")
    assert registry.names("effects").count("seeping") == 1
    with pytest.raises(InputError, match=r"tolevo-fake 1.2 and tolevo-other 3"):
        registry.load("effects", "seeping")
