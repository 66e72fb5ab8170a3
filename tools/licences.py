"""Licences of everything that an installation with all extras brings along: docs/licences.csv.

`python tools/licences.py` writes the table and the page docs/licences.md, `--check` fails where an
installed package is not in the table or has a licence that nobody has looked at. Packages of other
versions of Python may stay in it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

TABLE = Path(__file__).resolve().parents[1] / "docs" / "licences.csv"
PAGE = TABLE.with_suffix(".md")
EXTRAS = ("gap", "study")
BY_HAND = {"graphemeu": "MIT"}
"""Licences of packages whose metadata do not say: read in their files."""
KNOWN = {"moocore": "LGPL-2.1-or-later"}
"""Licences that ask for more than to be named; what follows from them stands on the page."""
PERMISSIVE = re.compile(r"MIT|BSD|Apache|ISC|PSF|Python Software Foundation|Unlicense|Zlib|HPND|0BSD|PIL|MPL-2|CC0")
HEAD = """# Licences

tolevo is MIT. At run time it uses the packages in [licences.csv](licences.csv) (with the extras {extras});
none of them is part of its wheel. All are permissive but one: **moocore is under the LGPL,
version 2.1 or later**. It is called at run time, as a library that may be replaced, for hypervolumes
and sorting of fronts. Who passes tolevo on together with it, in a container or a frozen application,
passes on its licence, its source or an offer of it, and a way to replace it.

`python tools/licences.py` writes page and table from the installed packages; `make lint` fails where
one of them is missing or comes under a licence that nobody has looked at.
"""


def licence_of(found: Distribution) -> str:
    """The licence as the package's metadata or, by hand, its files state it."""
    name = str(found.metadata["Name"]).lower()
    if name in BY_HAND:
        return BY_HAND[name]
    if stated := found.metadata.get_all("License-Expression"):
        return str(stated[0])
    marks = [one.split(" :: ")[-1] for one in found.metadata.get_all("Classifier") or ()
             if one.startswith("License ::") and one != "License :: OSI Approved"]  # fmt: skip
    text = str((found.metadata.get_all("License") or [""])[0]).strip().split("\n")[0]
    return ", ".join(marks) or text[:60] or "not stated"


def needed(name: str, extras: tuple[str, ...] = ()) -> Iterator[Requirement]:
    """Requirements of an installed distribution that apply here, with these extras."""
    for text in distribution(name).requires or ():
        one = Requirement(text)
        given = ({"extra": extra} for extra in ("", *extras))
        if one.marker is None or any(one.marker.evaluate(dict(each)) for each in given):
            yield one


def closure() -> dict[str, str]:
    """Names of the packages, each with the one that asked for it first."""
    found: dict[str, str] = {}
    open_ = [(one, "tolevo") for one in needed("tolevo", EXTRAS)]
    seen = set[tuple[str, tuple[str, ...]]]()
    while open_:
        one, parent = open_.pop(0)
        key, extras = re.sub(r"[-_.]+", "-", one.name).lower(), tuple(sorted(one.extras))
        if (key, extras) in seen:
            continue
        seen.add((key, extras))
        try:
            inner = list(needed(key, extras))
        except PackageNotFoundError:
            continue  # for another system
        found.setdefault(key, parent)
        open_ += [(each, key) for each in inner]
    return found


def table() -> tuple[str, list[str]]:
    """The table as CSV, and the packages whose licence nobody has looked at."""
    rows, doubted = ["package,licence,needed by\n"], []
    for name, parent in sorted(closure().items()):
        licence = licence_of(distribution(name))
        rows.append(f'{name},"{licence}",{parent}\n')
        if KNOWN.get(name) != licence and not PERMISSIVE.search(licence):
            doubted.append(f"{name}: {licence}")
    return "".join(rows), doubted


def main() -> int:
    """0 where the table is right."""
    text, doubted = table()
    for one in doubted:
        print(f"a licence that nobody has looked at: {one}", file=sys.stderr)
    if "--check" not in sys.argv:
        TABLE.write_text(text, encoding="utf-8")
        PAGE.write_text(HEAD.format(extras=", ".join(EXTRAS)), encoding="utf-8")
    elif missing := set(text.splitlines()) - set(TABLE.read_text("utf-8").splitlines()):
        print(f"docs/licences.csv lacks {sorted(missing)}: python tools/licences.py", file=sys.stderr)
        return 1
    return 1 if doubted else 0


if __name__ == "__main__":
    sys.exit(main())
