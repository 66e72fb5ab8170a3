"""What all pages share: the document, its sections and drawings, with every outside text escaped."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from math import isinf
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..records import limits_text, mechanism_lines, range_text, tables_of, worst_case_text
from ..units import plain_number, split_unit
from .drawing import as_svg

# One sentence for every term that the pages use.


TERMS: Mapping[str, str] = {
    "front": "The allocations to which no other is superior in every objective at once.",
    "bound": "A cost that no allocation of equal or better other objectives can be below: proven, not searched.",
    "gap": "By how much the cost of a point lies above its proven bound.",
    "knee": "The point of the front that lies farthest from the line between its ends.",
    "share": (
        "t dy/dt of a tolerance t in a requirement y, over its sum for all tolerances; of a root "
        "sum of squares that is the fraction of the variance."
    ),
    "price": "What one unit less of a requirement (of a yield one more) adds to the least cost.",
    "multiplier": "The price of a requirement at a proven optimum (Karush, Kuhn and Tucker).",
    "relaxed": "Compared with a front whose broken limits are as loose as those of the reference.",
    "hypervolume": ("The fraction of the problem's box, from ideal to nadir, that the front dominates."),
    "rounding loss": "What changes where every value is rounded to what can be ordered.",
    "feasible": "Whether all limits of the run are kept.",
    "margin": "The distance of a value from its nearest limit, negative where it is broken.",
    "yield": "The fraction of units that keep the limits of the requirement.",
    "Cpk": "The distance of the mean from the nearer limit, in three standard deviations.",
    "coverage": "The fraction of units that a quantile is stated for.",
    "reference": "An allocation of a document or of another method, by the same model.",
    "half-width": "A tolerance t of the zone from mid - t to mid + t.",
    "held-out": "Of measurements that the fit did not use.",
    "verdict": "The result of comparing model and measurement, or a claim and its recomputation.",
    "interaction": "How much the effect of one setting depends on another.",
}
"""By term, in the order in which the list shows them."""


def link(text: str) -> str:
    """A heading, linked to the explanation of the first term that it contains."""
    lowered = text.lower()
    for term in TERMS:
        if term.lower() in lowered:
            return f'<a href="#{anchor(term)}">{escape(text)}</a>'
    return escape(text)


def anchor(term: str) -> str:
    """The identifier of an explanation."""
    return "term-" + term.lower().replace(" ", "-")


def terms(body: str) -> str:
    """The explanations of the terms that a page links to, or names in its texts."""
    used: Sequence[str] = [term for term in TERMS if f'"#{anchor(term)}"' in body or f" {term}" in body]
    if not used:
        return ""
    rows = "\n".join(f'<dt id="{anchor(term)}">{escape(term)}</dt><dd>{escape(TERMS[term])}</dd>' for term in used)
    return f'<section>\n<h2>Terms</h2>\n<dl class="terms">\n{rows}\n</dl>\n</section>'


# The scripts of interactive pages, and the data that they show.


DIGITS = 6
"""Digits of a number on a page."""


@dataclass(frozen=True, slots=True)
class Script:
    """A script and the hash by which the page's policy allows it, and nothing else, to run."""

    text: str

    @property
    def hash(self) -> str:
        """The hash as a content security policy states it."""
        digest = hashlib.sha256(self.text.encode()).digest()
        return f"'sha256-{base64.b64encode(digest).decode()}'"

    @property
    def html(self) -> str:
        """The element."""
        return f"<script>{self.text}</script>"


def package_scripts(*names: str) -> Script:
    """The joined scripts of this package with these file names."""
    folder = files("tolevo.page") / "assets"
    return Script("\n".join((folder / name).read_text(encoding="utf-8") for name in names))


def data(content: Mapping[str, Any]) -> str:
    """The element with the data that a page's script reads; no text in it can end it."""
    text = json.dumps(short(content), allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return f'<script type="application/json" id="data">{text}</script>'


def short(value: Any) -> Any:
    """JSON with numbers of `DIGITS` digits; what is not finite is null."""
    if isinstance(value, Mapping):
        return {str(key): short(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [short(part) for part in value]
    if isinstance(value, np.ndarray):
        return short(value.tolist())
    if isinstance(value, np.generic):
        return short(value.item())
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        shown = float(f"{value:.{DIGITS}g}")
        return int(shown) if shown.is_integer() and abs(shown) < 1e15 else shown
    return value


# The design of all pages: one type scale, spacing, palette, in light, dark and print.
#
# The colours of series are those of Okabe & Ito (2008), darkened on white and lightened on black
# until each stands out from its background by 3 to 1 and texts by 4.5 to 1 (WCAG 2.2).


LIGHT = """--ink: #1b1b1b; --soft: #55595f; --paper: #ffffff; --card: #f6f7f9; --line: #d3d7dc;
  --mark: #fff0c2; --front: #0a63b0; --mark-ink: #9a5b00; --a: #b5400a; --b: #007558; --c: #99407a;
  --d: #6b5500; --e: #1d7fa8; --quiet: #8a8f96; --away: #c3c8ce; --link: #0a58a0;"""
DARK = """--ink: #e6e7e9; --soft: #a9afb7; --paper: #15181c; --card: #1d2126; --line: #3d444d;
  --mark: #463a12; --front: #6db5f2; --mark-ink: #f0b94a; --a: #ff9466; --b: #4fd0a9; --c: #e79ac9;
  --d: #d9c46a; --e: #7fd0f0; --quiet: #8b939d; --away: #454c55; --link: #8cc4ff;"""
STYLE = f"""
:root {{ color-scheme: light dark; {LIGHT}
  --s1: .25rem; --s2: .5rem; --s3: 1rem; --s4: 2rem; --small: .8125rem; --text: 1rem; }}
@media (prefers-color-scheme: dark) {{ :root {{ {DARK} }} }}
@media print {{ :root {{ color-scheme: light; {LIGHT} }} }}
"""
STYLE += """
* { box-sizing: border-box; }
body { color: var(--ink); background: var(--paper); font: var(--text)/1.45 system-ui, sans-serif;
  max-width: 96rem; margin: 0 auto; padding: var(--s2) var(--s3); }
h1 { font-size: 1.4rem; margin: var(--s1) 0; }
h2 { font-size: 1.15rem; margin: var(--s4) 0 var(--s2); border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: var(--s3) 0 var(--s1); }
h1, h2, h3, p, li, summary, dd { overflow-wrap: anywhere; }
td, th { overflow-wrap: break-word; }
p { margin: var(--s1) 0; }
a { color: var(--link); }
th a { color: inherit; text-decoration: underline dotted; }
summary { cursor: pointer; }
:focus-visible { outline: 3px solid var(--front); outline-offset: 1px; }
figure { margin: 0; }
figure svg { max-width: 100%; height: auto; background: #ffffff; border-radius: 4px; }
figcaption, .hint, caption { font-size: var(--small); color: var(--soft); text-align: left; }
.answers { margin: 0; padding: 0; list-style: none; font-size: .875rem; }
.answers li { margin: 1px 0; }
.asked { font-weight: 600; margin: 0; font-size: .9rem; }
.scroll { overflow: auto; max-height: 30rem; border: 1px solid var(--line); border-radius: 4px; }
table { border-collapse: collapse; font-size: var(--small); }
caption { padding: var(--s1) var(--s2); }
th, td { border-bottom: 1px solid var(--line); padding: 2px var(--s2); text-align: left;
  vertical-align: top; }
thead th { position: sticky; top: 0; background: var(--card); }
tbody th { font-weight: normal; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
td small { color: var(--soft); font-size: .75rem; }
tr.mark { background: var(--mark); }
pre { overflow: auto; border: 1px solid var(--line); padding: var(--s2); font-size: var(--small); }
.bar { display: block; height: .4rem; margin: 1px 0; min-width: 3rem; }
.bar span { display: block; height: 100%; background: var(--front); }
.bar .other { background: var(--a); }
.bar .ref { background: repeating-linear-gradient(45deg, var(--ink) 0 2px, transparent 2px 5px);
  border: 1px solid var(--ink); }
.bars { display: block; min-width: 6rem; }
.work { display: grid; gap: var(--s2) var(--s3); grid-template-columns: minmax(0, 1fr);
  background: var(--card); border: 1px solid var(--line); border-radius: 6px; padding: var(--s2);
  margin-top: var(--s2); }
.work[hidden] { display: none; }
.work h2 { margin: 0; border: 0; font-size: 1.05rem; }
.left, .right { min-width: 0; }
.plot { position: relative; width: 100%; height: 24rem; background: var(--paper);
  border: 1px solid var(--line); border-radius: 4px; touch-action: pan-y; overflow: hidden; }
.chart { display: block; width: 100%; height: 100%; font-size: 12px; user-select: none; }
.chart text { fill: var(--soft); }
.chart .small { font-size: 10px; }
.chart .grid, .chart .axis { stroke: var(--line); fill: none; stroke-width: 1; }
.chart .ring { fill: none; stroke: var(--ink); stroke-width: 3; }
.chart .brush { fill: var(--mark-ink); fill-opacity: .35; stroke: var(--mark-ink); }
.tip { position: absolute; pointer-events: none; background: var(--ink); color: var(--paper);
  font-size: var(--small); padding: 2px var(--s2); border-radius: 4px; max-width: 15rem;
  z-index: 2; }
.key { position: absolute; top: var(--s1); right: var(--s1); max-width: 60%; z-index: 1;
  background: var(--paper); border: 1px solid var(--line); border-radius: 4px; padding: 2px 6px;
  font-size: var(--small); }
.legend { list-style: none; margin: 0; padding: 0; font-size: var(--small); }
.legend li { display: flex; gap: 6px; align-items: center; }
.legend svg { flex: none; }
.asks { display: flex; flex-wrap: wrap; gap: 2px var(--s3); align-items: center;
  margin-bottom: var(--s1); font-size: .875rem; }
.asks > details, .asks > p { margin: 0; }
.asks > details[open], .asks > p:not(:empty) { flex-basis: 100%; }
.asks input { width: 5.5rem; }
input, select, button { font: inherit; color: var(--ink); background: var(--paper);
  border: 1px solid var(--quiet); border-radius: 4px; padding: 1px 6px; }
button { padding: 2px 10px; }
[role="tab"][aria-selected="true"] { background: var(--front); color: var(--paper); }
#views { display: flex; gap: var(--s1); margin: var(--s1) 0; }
#controls { display: flex; flex-wrap: wrap; gap: 2px var(--s3); font-size: .875rem; }
#controls label { display: flex; gap: 6px; align-items: center; flex: 1 1 14rem; }
#controls select, #controls input { flex: 1; min-width: 0; width: 100%; }
#controls [hidden] { display: none; }
#slope p { font-size: .875rem; }
#exports { display: flex; flex-wrap: wrap; gap: var(--s1); }
[data-filter] .scroll { max-height: none; }
#told { font-size: .875rem; font-weight: 600; }
.unverified { color: var(--a); }
.verified { color: var(--b); }
.fields > div { display: flex; flex-wrap: wrap; gap: 4px; margin: 2px 0; font-size: var(--small); }
.fields > div > span { min-width: 14rem; }
.histogram .plot { height: 13rem; }
#parallel .plot { height: 26rem; }
.many { display: grid; gap: var(--s2);
  grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); }
.many .plot { height: 15rem; }
dl.terms { font-size: .875rem; }
dl.terms dt { font-weight: 600; }
dl.terms dd { margin: 0 0 var(--s1) var(--s3); }
details { margin: var(--s1) 0; }
@media (min-width: 1000px) {
  .work { grid-template-columns: minmax(0, 4fr) minmax(0, 5fr); }
  #allocation { max-height: 21.5rem; }
  .plot { height: 26rem; }
}
@media (max-width: 999px) { #allocation { max-height: none; } }
@media print, (min-width: 601px) { section.sheet td:nth-child(2) { white-space: nowrap; } }
@media (max-width: 600px) {
  .cards thead { position: absolute; width: 1px; height: 1px; overflow: hidden;
    clip-path: inset(50%); }
  .cards, .cards caption, .cards tbody, .cards tr, .cards td, .cards th { display: block;
    width: 100%; }
  .cards tr { border-bottom: 2px solid var(--line); padding: var(--s1) 0; }
  .cards th, .cards td { border: 0; padding: 1px var(--s2); overflow-wrap: anywhere; }
  .cards tbody th { font-weight: 600; }
  .cards td { display: flex; justify-content: space-between; gap: var(--s3); text-align: right; }
  .cards td:empty { display: none; }
  .cards td::before { content: attr(data-head); color: var(--soft); text-align: left; }
  .fields > div > span { min-width: 100%; }
  .scroll { max-height: none; }
}
@page { margin: 14mm; }
@media print {
  section:not(.sheet) .scroll table { font-size: 8pt; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  .scroll { overflow: visible; max-height: none !important; border: 0; }
  .work { grid-template-columns: minmax(0, 1fr); border: 0; background: none; padding: 0; }
  #asks, #controls, #views, #exports, #parallel, .work .hint, .key summary { display: none; }
  .key:not([open]) { display: none; }
  .plot { height: 11cm; break-inside: avoid; }
  tr, figure, section.sheet { break-inside: avoid; }
  section.sheet { break-after: page; }
  body.sheet > main > :not(.work), body.sheet > header > :not(h1), body.sheet .left,
  body.sheet #slope, body.sheet #units, body.sheet > footer { display: none; }
}
"""


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


def add_reload(text: str) -> str:
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


def folded_section(title: str, body: str) -> str:
    """A part that opens on a click on its title; `body` is HTML."""
    return f"<details><summary>{escape(title)}</summary>\n{body}</details>"


def about(summary: Mapping[str, Any]) -> str:
    """The paragraphs on the mechanism of a result, by its summary."""
    return "".join(f"<p>{escape(line)}</p>\n" for line in mechanism_lines(summary))


def remarks_section(remarks: Sequence[str]) -> tuple[str, ...]:
    """The section on what was wrong with the files that a page is built from, if anything was."""
    return (section("What is wrong with the files", bullets(remarks)),) if remarks else ()


# Tables as HTML, numbers rounded for reading; the files next to the page have all digits.


CARDS, CELLS = 14, 1500
"""Columns and cells up to which a table becomes cards on a narrow screen; others are scrolled."""
MIN_WHOLE_NUMBER = 1e4
"""From here on a number is shown without decimals."""


def shown(value: Any) -> str:
    """A cell as text: four digits, yes or no, empty where unknown."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None or value is pd.NA or value is pd.NaT:
        return ""
    if isinstance(value, Real):
        return _number(value)
    return str(value)


def _number(value: Real) -> str:
    number = float(value)
    if np.isnan(number):
        return ""
    if isinstance(value, Integral) or (abs(number) >= MIN_WHOLE_NUMBER and not isinf(number)):
        return f"{number:.0f}"
    return f"{number:.4g}"


def table(frame: pd.DataFrame, marked: Sequence[bool] = (), caption: str = "") -> str:
    """An HTML table; `marked` rows are emphasised."""
    if frame.empty:
        return "<p>None.</p>"
    marks = marked or [False] * len(frame)
    head = "".join(f'<th scope="col" title="{escape(str(name))}">{heading(str(name))}</th>' for name in frame.columns)
    heads = _heads(frame)
    columns = [frame[name].tolist() for name in frame.columns]
    body = "\n".join(_row(cells, mark, heads) for cells, mark in zip(zip(*columns, strict=True), marks, strict=True))
    label = caption or "table of " + ", ".join(str(n).replace("_", " ") for n in frame.columns[:3])
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="scroll" tabindex="0" role="group" aria-label="{escape(label)}">'
        f"<table{' class=cards' if heads else ''}>{title}<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def described(text: str, frame: pd.DataFrame, marked: Sequence[bool] = ()) -> str:
    """A paragraph, and below it the table that it explains."""
    return f"<p>{escape(text)}</p>\n{table(frame, marked)}"


def declared_tables(result: object) -> dict[str, str]:
    """The tables of a result whose declarations have a heading, by that, as HTML below their texts."""
    bodies = {}
    for name, declared in tables_of(result).items():
        if declared.heading and (frame := getattr(result, name)) is not None:
            column, value = declared.marked
            marks = [cell == value for cell in frame[column]] if column in frame else []
            bodies[declared.heading] = described(declared.text, frame, marks)
    return bodies


def listed(records: Iterable[object], columns: str) -> pd.DataFrame:
    """A row per record with its attributes `columns`, which are separated by commas; the column of
    "low: from" has the attribute `low` under the name "from".
    """
    pairs = [column.partition(": ")[::2] for column in columns.split(", ")]
    rows = [[getattr(record, attribute) for attribute, _ in pairs] for record in records]
    return pd.DataFrame(rows, columns=[name or attribute for attribute, name in pairs])


def chosen(frame: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """The columns of `names` that the table has, in that order."""
    return frame[[name for name in dict.fromkeys(names) if name in frame]]


def heading(name: str) -> str:
    """A column in words with its unit, linked to the explanation of its term."""
    stem, unit = split_unit(name)
    stem, unit = (name.removesuffix("_percent"), "%") if name.endswith("_percent") else (stem, unit)
    return link(stem.replace("_", " ") + (f" [{unit}]" if unit and unit != name else ""))


def _heads(frame: pd.DataFrame) -> list[str]:
    """The heads of the cells where a row becomes a card; none for a table that is too large."""
    if len(frame.columns) > CARDS or frame.size > CELLS:
        return []
    return [str(name).replace("_", " ") for name in frame.columns]


def _row(cells: Sequence[Any], mark: bool, heads: Sequence[str]) -> str:
    body = "".join(map(_cell, cells, heads or [""] * len(cells)))
    return f"<tr{' class=mark' if mark else ''}>{body}</tr>"


def _cell(value: Any, head: str) -> str:
    text = shown(value)  # an empty text comes back from a file as no number: both are empty
    number = bool(text) and isinstance(value, Real) and not isinstance(value, bool)
    kind, named = " class=n" if number else "", f' data-head="{escape(head)}"' if head else ""
    return f"<td{kind}{named}>{escape(text)}</td>"


# The requirements of a stack, as `tolevo analyse` and a run show them.


def requirements_view(requirements: pd.DataFrame) -> pd.DataFrame:
    """The requirements of an analysis as a page shows them: a range in a single cell."""
    rows = [{str(name): value for name, value in row.items()} for row in requirements.to_dict("records")]
    tolerances = {"tolerances": requirements["tolerances"]} if "tolerances" in requirements else {}
    return pd.DataFrame(
        {
            **tolerances,
            "requirement": [row["requirement"] for row in rows],
            "unit": [row["unit"] for row in rows],
            "limits": [limits_text(row["lower"], row["upper"]) or "none" for row in rows],
            "nominal": [row["nominal"] for row in rows],
            "mean": [row["mean"] for row in rows],
            "standard deviation": [row["std"] for row in rows],
            "worst case": [worst_case_text(row) for row in rows],
            "mean ± 3 standard deviations": [range_text(row["rss_least"], row["rss_greatest"]) for row in rows],
            "Cp": [row["cp"] for row in rows],
            "Cpk": [row["cpk"] for row in rows],
            "yield_percent": [_digits(row["yield_percent"]) for row in rows],
            "ppm outside": [_ppm(row) for row in rows],
        }
    )


def _digits(percent: float) -> str:
    """A yield with enough digits to tell 99.99 from 99.9999."""
    return "" if np.isnan(percent) else f"{percent:.7g}"


def _ppm(row: dict[str, Any]) -> str:
    if np.isnan(row["ppm"]):
        return ""
    error = f" ± {plain_number(row['ppm_error'], 2)}" if row["ppm_error"] >= 0.5 else ""
    return f"{plain_number(row['ppm'])}{error}"


# The page of a result that is not finished and has no front yet.


def unfinished_page(
    title: str,
    command: str,
    facts: Sequence[str],
    remarks: Sequence[str] = (),
    tables: Mapping[str, pd.DataFrame] = MappingProxyType({}),
) -> str:
    """What `tolevo <command>` has saved so far: `facts` in sentences, and `tables` by title."""
    message = f"This result of `tolevo {command}` is unfinished."
    body = (
        *remarks_section(remarks),
        section("Unfinished", f"<p>{escape(message)}</p>\n{bullets(facts)}"),
        *(section(name, table(frame)) for name, frame in tables.items()),
    )
    return document(title, body)
