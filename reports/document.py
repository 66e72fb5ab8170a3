"""What all pages share: one document, its sections and drawings, every outside text escaped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

from matplotlib.figure import Figure

from .drawing import as_svg
from .glossary import terms
from .scripts import Script
from .style import STYLE

RENEWED = 5
"""Seconds after which a browser loads the page of a result that is being made again."""


def document(title: str, body: str, scripts: Sequence[Script] = (), head: str = "") -> str:
    """The whole page of that title; `scripts` run at its end, and nothing else can.

    `head` (HTML) stands below the title, before all sections; the terms are explained at the end.
    """
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
    """A page that the browser loads again by itself, for its result is being made."""
    return text.replace("<title>", f'<meta http-equiv="refresh" content="{RENEWED}">\n<title>', 1)


def section(title: str, body: str) -> str:
    """A part with its heading; `body` is HTML."""
    return f"<section>\n<h2>{escape(title)}</h2>\n{body}\n</section>"


def picture(name: str, figure: Figure, caption: str) -> str:
    """A drawing with its caption, which is its text alternative too; `name` is unique."""
    drawing = as_svg(figure).decode()
    drawing = drawing[drawing.index("<svg") :]
    # Two drawings on one page must not share identifiers.
    drawing = re.sub(r'\bid="', f'id="{name}-', drawing)
    drawing = re.sub(r'href="#', f'href="#{name}-', drawing)
    drawing = drawing.replace("url(#", f"url(#{name}-")
    drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{escape(caption)}" ', 1)
    return f"<figure>{drawing}<figcaption>{escape(caption)}</figcaption></figure>"


def bullets(notes: Sequence[str]) -> str:
    """A list of plain sentences."""
    if not notes:
        return "<p>None.</p>"
    return "<ul>\n" + "\n".join(f"<li>{escape(note)}</li>" for note in notes) + "\n</ul>"


def folded(title: str, body: str) -> str:
    """A part that opens when it is asked for; `body` is HTML."""
    return f"<details><summary>{escape(title)}</summary>\n{body}</details>"


def remarked(remarks: Sequence[str]) -> tuple[str, ...]:
    """The section on what was wrong with the files that a page is built from, if anything was."""
    return (section("What is wrong with the files", bullets(remarks)),) if remarks else ()
