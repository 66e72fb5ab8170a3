"""What all pages share: the document, its sections and drawings, with every outside text escaped."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from matplotlib.figure import Figure

from ..records import mechanism_lines
from .drawing import as_svg
from .glossary import terms
from .scripts import Script
from .style import STYLE

RENEWED = 5
"""Seconds after which a browser reloads the page of a result that is being computed."""


def document(title: str, parts: Iterable[str], scripts: Sequence[Script] = (), head: str = "") -> str:
    """The whole page: its title, `head` (HTML), all `parts` (HTML) that are not empty, and the
    explanations of the terms. Only `scripts` can run, at its end.
    """
    body = "\n".join(filter(None, parts))
    name, explained = escape(title), terms(body)
    policy = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
    if scripts:
        policy += f"; img-src data:; script-src {' '.join(script.hash for script in scripts)}"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<header>\n<h1>{name}</h1>\n{head}\n</header>\n"
        f"<main>\n{body}\n{explained}\n</main>\n"
        f"{''.join(script.html for script in scripts)}\n</body>\n</html>\n"
    )


def renewed(text: str) -> str:
    """A page that the browser loads again by itself, because its result is being computed."""
    return text.replace("<title>", f'<meta http-equiv="refresh" content="{RENEWED}">\n<title>', 1)


def section(title: str, body: str) -> str:
    """A part with its heading; `body` is HTML."""
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>"


def picture(name: str, figure: Figure, caption: str) -> str:
    """A drawing with its caption, which is its text alternative too; `name` is unique."""
    drawing = as_svg(figure).decode()
    # Two drawings on one page must not share identifiers.
    drawing = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", drawing[drawing.index("<svg") :])
    drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{escape(caption)}" ', 1)
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def bullets(notes: Sequence[str]) -> str:
    """A list of plain sentences."""
    if not notes:
        return "<p>None.</p>"
    return "<ul>\n" + "\n".join(f"<li>{escape(note)}</li>" for note in notes) + "\n</ul>"


def folded(title: str, body: str) -> str:
    """A part that opens on a click on its title; `body` is HTML."""
    return f"<details><summary>{escape(title)}</summary>\n{body}</details>"


def about(summary: Mapping[str, Any]) -> str:
    """The paragraphs on the mechanism of a result, by its summary."""
    return "".join(f"<p>{escape(line)}</p>\n" for line in mechanism_lines(summary))


def remarked(remarks: Sequence[str]) -> tuple[str, ...]:
    """The section on what was wrong with the files that a page is built from, if anything was."""
    return (section("What is wrong with the files", bullets(remarks)),) if remarks else ()
