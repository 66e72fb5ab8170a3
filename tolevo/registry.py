"""Models, problems, algorithms, effects and all other kinds of plugins by name.

Names, origins and summaries come from the metadata of installed distributions (entry points) and
from source text; a plugin is imported only when it is used.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from functools import lru_cache
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution, entry_points, version
from importlib.util import resolve_name
from inspect import getattr_static
from pathlib import Path
from typing import Any, TypeVar, cast

from .errors import Fault, InputError, nearest, refuse

Kind = TypeVar("Kind")
PATH = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")
"""A class that is named by its module instead of an entry point."""
PLUGIN_FAULTS = (Exception, SystemExit)
"""What the code of a broken plugin may raise: a fault of the user's input that names the plugin."""
BASES = {
    "models": "tolevo.models.measurable:MeasurableModel",
    "problems": "pymoo.core.problem:Problem",
    "algorithms": "tolevo.algorithms.settings:AlgorithmSettings",
    "effects": "tolevo.models.effects.effect:Effect",
    "calculations": "tolevo.commands.reproduce.recipes:Calculation",
    "curves": "tolevo.models.costs:CostCurve",
    "distributions": "tolevo.models.inputs:Distribution",
    "designs": "tolevo.commands.study.plan:Design",
    "rules": "tolevo.commands.run.choice:ChoiceRule",
    "pages": "tolevo.records:PageSection",
}
"""The class that every class of a group is a subclass of; it is imported when one is used."""
SETTINGS = ("algorithms", "curves", "designs", "distributions")
"""Groups whose classes are dataclasses: their fields are keys of a configuration."""
SHOWN = 80
"""Characters of a name that a message repeats."""


def _offers(group: str) -> tuple[EntryPoint, ...]:
    """The entry points of a group, by name."""
    return _entry_points_on_path(group, tuple(sys.path))


@lru_cache(maxsize=32)
def _entry_points_on_path(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """The entry points of a group of the distributions on `path` (`sys.path`)."""
    offers = _all_on_path(path).select(group=f"tolevo.{group}")
    return tuple(sorted(offers, key=lambda offer: (offer.name, offer.value)))


@lru_cache(maxsize=4)
def _all_on_path(path: tuple[str, ...]) -> Any:
    """Those of every group: the metadata of all distributions are read once."""
    return entry_points()


def _origin(offer: EntryPoint) -> str:
    return _name_and_version(offer.dist) if offer.dist is not None else "unknown"


@lru_cache
def _name_and_version(dist: Distribution) -> str:
    """Its name and version, which are read from its metadata."""
    return f"{dist.name} {dist.version}"


def names(group: str) -> list[str]:
    """Every registered name of a group."""
    return list(dict.fromkeys(offer.name for offer in _offers(group)))


def _find(group: str, name: str) -> EntryPoint:
    """The only entry point of that name.

    Raises InputError where there is none, or where two distributions offer it.
    """
    offers = [offer for offer in _offers(group) if offer.name == name]
    kind = group.removesuffix("s")
    if not offers:
        known = names(group)
        listed = f"installed: {', '.join(known)}" if known else "none is installed"
        raise refuse(kind, f'"{name}" is not an installed {kind}{nearest(name, known)}; {listed}')
    if len(offers) > 1:
        both = " and ".join(sorted(_origin(offer) for offer in offers))
        raise refuse(kind, f'"{name}" is offered by {both}; uninstall one of them')
    return offers[0]


def origin(group: str, name: str) -> str:
    """Distribution and version that offer `name`."""
    return _origin(_find(group, name))


def load(group: str, name: str) -> Any:
    """The class registered as `name`, or the one at the path "package.module:Class".

    Nothing but its module is run before it is known to be a class of the group. Raises InputError
    where the name is unknown, where it cannot be imported, where it is no such class, or where an
    extra that it names in `extras` is not installed.
    """
    kind, short = group.removesuffix("s"), name if len(name) <= SHOWN else f"{name[:SHOWN]}..."
    offer = None if PATH.fullmatch(name) else _find(group, name)
    module, _, attribute = name.partition(":") if offer is None else (offer.module, "", offer.attr)
    whose = "" if offer is None else f" of {_origin(offer)} ({offer.value})"
    try:
        loaded = _member(import_module(module), attribute.split("."))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a module may raise anything while it is imported
        remedy = "" if offer else "; its module must be installed, or lie in a directory of PYTHONPATH"
        reason = f"{type(error).__name__}: {error}" if len(name) <= SHOWN else type(error).__name__
        raise refuse(kind, f'"{short}"{whose} cannot be imported ({reason}){remedy}') from error
    if complaint := _misfit(group, loaded):
        raise refuse(kind, f'"{short}"{whose} {complaint}')
    for extra in getattr(loaded, "extras", ()):
        if (
            offer is not None
            and offer.dist is not None
            and (missing := _missing_packages(offer.dist.requires or [], extra))
        ):
            command = f"pip install '{offer.dist.name}[{extra}]'"
            raise refuse(kind, f'"{name}" needs {", ".join(missing)}: {command}')
    return loaded


def _member(module: Any, names: list[str]) -> Any:
    """A name of a module, or of a class in it, by which no code of an object is run."""
    member = getattr(module, names[0])
    for name in names[1:]:
        if not isinstance(member, type):
            raise AttributeError(f"{names[0]} is not a class")
        member = getattr_static(member, name)
    return member


def _misfit(group: str, loaded: Any) -> str:
    """Why an object is not a class of a group that can be used; empty where it is one."""
    module, _, name = BASES[group].partition(":")
    wanted = f"it must be a subclass of {name} ({module})"
    if not isinstance(loaded, type):
        return f"is not a class: {wanted}"
    if not issubclass(loaded, getattr(import_module(module), name)):
        return f"is not a class of {group}: {wanted}"
    if missing := _missing_members(loaded):
        return f"cannot be used: it does not state {', '.join(missing)}"
    if group in SETTINGS and not is_dataclass(loaded):
        return "cannot be used: it must be a dataclass, whose fields are its settings"
    return ""


@lru_cache
def _missing_members(kind: type) -> tuple[str, ...]:
    """Members that the bases of a class leave to it, and that it does not have."""
    stated = {key for base in kind.__mro__ for key in vars(base)}
    declared = (item for base in kind.__mro__ for item in vars(base).get("__annotations__", {}).items())
    lacking = [key for key, form in declared if str(form).startswith("ClassVar") and key not in stated]
    abstract = [key for key in dir(kind) if getattr(getattr_static(kind, key), "__isabstractmethod__", False)]
    return tuple(dict.fromkeys([*lacking, *abstract]))


def name_of(group: str, kind: type) -> str:
    """The name under which a class is registered, else its path."""
    for offer in _offers(group):
        if offer.attr == kind.__qualname__ and _is_imported(offer) and offer.load() is kind:
            return offer.name
    return f"{kind.__module__}:{kind.__qualname__}"


class Kinds(Mapping[str, type[Kind]]):
    """The classes of a group by their names in configurations; each is imported when it is used."""

    def __init__(self, group: str) -> None:
        self.group = group

    def __getitem__(self, name: str) -> type[Kind]:
        if name not in names(self.group):
            raise KeyError(name)
        return cast("type[Kind]", load(self.group, name))

    def __iter__(self) -> Iterator[str]:
        return iter(names(self.group))

    def __len__(self) -> int:
        return len(names(self.group))

    def sound(self) -> dict[str, type[Kind]]:
        """Our classes, and those of plugins that are imported already since a configuration named
        them. A class that cannot be used is reported when it is used.
        """
        classes = {}
        for name in dict.fromkeys(offer.name for offer in _offers(self.group) if _is_imported(offer)):
            try:
                classes[name] = self[name]
            except InputError:
                continue
        return classes

    def name_of(self, kind: type) -> str:
        """The name of a class in configurations. Raises LookupError where it is not registered."""
        for name, registered in self.sound().items():
            if registered is kind:
                return name
        raise LookupError(f"{kind.__module__}.{kind.__qualname__} is not an entry point of tolevo.{self.group}")


def _is_imported(offer: EntryPoint) -> bool:
    """Whether the package of an entry point is imported already: no unused plugin is run."""
    return offer.module.partition(".")[0] in sys.modules


def needed(extra: str) -> list[Fault]:
    """A fault where packages of an extra of ours are not installed, with the command."""
    try:
        requires = distribution("tolevo").requires or []
    except PackageNotFoundError:
        return []
    missing = _missing_packages(requires, extra)
    command = f"pip install 'tolevo[{extra}]'"
    return [Fault(extra, f"needs {', '.join(missing)}: {command}")] if missing else []


def _missing_packages(requirements: list[str], extra: str) -> list[str]:
    """The packages of an extra that are not installed."""
    marker = re.compile(rf"""extra *== *["']{re.escape(extra)}["']""")
    wanted = [re.split(r"[^\w.-]", requirement)[0] for requirement in requirements if marker.search(requirement)]
    return [name for name in wanted if not _is_installed(name)]


def _is_installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def describe(group: str, name: str) -> str:
    """First line of the docstring of `name`, read from its source without importing it."""
    return _summary(_find(group, name))


def listing() -> dict[str, list[dict[str, str]]]:
    """Every group with its entries: name, description, origin; of effects the family as well."""
    return {
        group: [
            {"name": offer.name, "description": _summary(offer), "origin": _origin(offer)} | _family(offer, group)
            for offer in _offers(group)
        ]
        for group in BASES
    }


# ---------------------------------------------------------------- source text, never executed


def _summary(offer: EntryPoint) -> str:
    node = _definition(offer.module, offer.attr)
    document = ast.get_docstring(node) if node is not None else ""
    return (document or "").strip().partition("\n")[0].strip() or "(no description)"


def _family(offer: EntryPoint, group: str) -> dict[str, str]:
    """The family of an effect, where its class states it as text."""
    node = _definition(offer.module, offer.attr) if group == "effects" else None
    for line in node.body if node is not None else ():
        if isinstance(line, ast.Assign) and isinstance(line.value, ast.Constant):
            names = [target.id for target in line.targets if isinstance(target, ast.Name)]
            if "family" in names:
                return {"family": str(line.value.value)}
    return {}


def _definition(module: str, attribute: str, depth: int = 5) -> ast.ClassDef | ast.FunctionDef | None:
    """The source of a class or function, followed through re-exports."""
    spec = _spec(module)
    if spec is None or depth == 0:
        return None
    try:
        tree = ast.parse(Path(spec.origin or "").read_text(encoding="utf-8"))
    except (OSError, ValueError, SyntaxError):
        return None
    package = module if spec.submodule_search_locations is not None else module.rpartition(".")[0]
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == attribute:
            return node
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if (alias.asname or alias.name) == attribute:
                    source = "." * node.level + (node.module or "")
                    return _definition(resolve_name(source, package), alias.name, depth - 1)
    return None


def _spec(module: str) -> ModuleSpec | None:
    """Where a module lies; unlike importlib.util.find_spec it imports no parent package."""
    spec: ModuleSpec | None = None
    parts = module.split(".")
    for end in range(1, len(parts) + 1):
        if end > 1 and (spec is None or spec.submodule_search_locations is None):
            return None
        where = None if spec is None else list(spec.submodule_search_locations or ())
        specs = (finder.find_spec(".".join(parts[:end]), where) for finder in sys.meta_path)
        spec = next((candidate for candidate in specs if candidate is not None), None)
    return spec
