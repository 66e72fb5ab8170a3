"""The tables of a run of the benchmark, as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path
from textwrap import fill

import numpy as np

from benchmarks.gap.generator.records import BENCH_GROUPS
from benchmarks.gap.namers.baselines import BASELINES
from benchmarks.gap.scoring.breakdown import Level, hidden, levels, misses, noise, of_group, of_single
from benchmarks.gap.scoring.dominant import GROUP, best_of, dominant_figures
from benchmarks.gap.scoring.scorer import Figure, Scored, clopper_pearson, falsely_named, figures

MEASURED, NEWER = "measured", "newer"
"""Parts of the page that tables are written to: those of most groups, and of the groups in `NEWER_GROUPS` alone."""
NEWER_GROUPS = frozenset(["approximate", "rows", "memory", "plays"])
NOTES = {"plain BIC": "11 to 24 %", "LassoCV": "33 %", "thresholded least squares": "100 %"}
"""Clean records that are given a name, by the project's notes."""
HERTZ = "97 to 100 %"
"""Records of a law T^(2/3) that the library has not, by the same."""
LAWS_OF_TORQUE = {"cubic_torque", "third_root_of_torque", "progressive_torque", "degressive_torque"}
MISSES = "Every record that counts against it, alike ones together:"
SHOWN = 6
"""Numbers of records that a line of misses lists."""

Answers = Mapping[str, Sequence[Scored]]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    first, *others = ("| " + " | ".join(cells) + " |" for cells in (head, *rows))
    return "\n".join([first, "|" + "---|" * len(head), *others])


def both_sides(lines: list[list[str]]) -> list[list[str]]:
    """Figures that have goals on both sides, ", at least" and ", at most", in one line where both are met alike."""
    joined: list[list[str]] = []
    for line in lines:
        name = line[0].removesuffix(", at most")
        if name != line[0] and joined and joined[-1][0] == f"{name}, at least" and joined[-1][3:] == line[3:]:
            ends = zip(joined[-1][1:3], line[1:3], strict=True)
            joined[-1][:3] = [
                name,
                *(f"{low.removeprefix('>= ').removesuffix(' %')} to {high.removeprefix('<= ')}" for low, high in ends),
            ]
        else:
            joined.append(line)
    return joined


def number(value: float, rate: bool) -> str:
    return "-" if isnan(value) else f"{100.0 * value:.1f}" if rate else f"{value:.2f}"


def goal(value: float, one: Figure) -> str:
    text = f"{100.0 * value:g} %" if one.rate else f"{value:g}"
    return f"{'<=' if one.at_most else '>='} {text}"


def cell(one: Figure, name: str) -> str:
    """A figure of a method, and where it is not met, that; with interval and number but for baselines."""
    if one.count == 0:
        return "-"
    low, high = number(one.low, one.rate), number(one.high, one.rate)
    word = "" if one.met else f" {one.word}"
    unit = " %" if one.rate else ""
    sample = "" if name in BASELINES else f" [{low}, {high}] of {one.count}"
    return f"{number(one.value, one.rate)}{unit}{sample}{word}"


def figure_table(answers: Answers) -> str:
    """Figures by namers, or by families; some are of one family alone."""
    columns = {name: {one.name: one for one in figures(found)} for name, found in answers.items()}
    every = {name: one for column in columns.values() for name, one in column.items() if one.count}
    lines = [
        [name, goal(one.must, one), goal(one.aim, one),
         *(cell(column[name], by) if name in column else "-" for by, column in columns.items())]
        for name, one in every.items()
    ]  # fmt: skip
    return table(["figure", "must", "aim", *columns], both_sides(lines))


def share_of(hits: int, count: int) -> str:
    if count == 0:
        return "-"
    low, high = clopper_pearson(hits, count)
    bounds = f"[{100.0 * low:.1f}, {100.0 * high:.1f}]"
    return f"{100.0 * hits / count:.1f} % {bounds}, {hits} of {count}"


def dominant_table(answers: Answers) -> str:
    """The figures of records with a dominant effect, by namers."""
    own = {name: [one for one in found if one.truth.group == GROUP]
           for name, found in answers.items()}  # fmt: skip
    columns = {name: dominant_figures(found, best_of(own, name)) for name, found in own.items()
               if found}  # fmt: skip
    if not columns:
        return ""
    lines = [
        [same[0].name, goal(same[0].must, same[0]), goal(same[0].aim, same[0]), *map(cell, same, columns)]
        for same in zip(*columns.values(), strict=True)
    ]
    return table(["figure", "must", "aim", *columns], both_sides(lines))


def baseline_table(answers: Answers) -> str:
    """Names given to clean records and to causes outside the library, beside the notes."""
    lines = []
    for name in [one for one in answers if one in BASELINES]:
        clean = of_group(answers[name], "clean")
        outside = [one for one in of_group(answers[name], "outside") if one.nothing_like_it]
        laws = [one for one in outside if set(one.truth.names) <= LAWS_OF_TORQUE]
        lines.append([
            name, share_of(sum(map(falsely_named, clean)), len(clean)), NOTES.get(name, ""),
            share_of(sum(one.said.named for one in laws), len(laws)), HERTZ,
            share_of(sum(one.said.named for one in outside), len(outside)),
        ])  # fmt: skip
    head = ["a name is given to", "clean records", "notes", "other laws of the torque", "notes",
            "all that is outside the library"]  # fmt: skip
    return table(head, lines)


def level_table(found: Sequence[Level]) -> str:
    lines = [
        [one.by if k == 0 or found[k - 1].by != one.by else "", one.level,
         share_of(one.hits, one.count)]
        for k, one in enumerate(found)
    ]  # fmt: skip
    return table(["by", "", "share"], lines)


def abbreviated(places: Sequence[str]) -> str:
    """The first records of a list, and how many more."""
    more = f" and {len(places) - SHOWN} more" if len(places) > SHOWN else ""
    return ", ".join(places[:SHOWN]) + more


def miss_table(found: Sequence[Scored]) -> str:
    lines = []
    for one in misses(found):
        places = [f"{group} {k}" for group, k in one.records]
        lines.append([", ".join(one.hidden) or "nothing", one.said, str(len(places)), abbreviated(places)])
    return table(["hidden", "said", "times", "records"], lines)


def time_table(seconds: Mapping[str, Sequence[float]]) -> str:
    lines = [
        [name, str(len(of)), f"{np.median(of):.3g}", f"{max(of):.3g}", f"{sum(of):.0f}"] for name, of in seconds.items()
    ]
    return table(["", "records", "median [s]", "largest [s]", "together [s]"], lines)


def in_detail(name: str, found: Sequence[Scored]) -> list[str]:
    """What the figures of one namer are made of."""
    parts = [f"### {name} in detail"]
    if single := of_single(found):
        parts += ["A single hidden effect named rightly, nothing spurious beside it:",
                  level_table(single)]  # fmt: skip
    if clean := of_group(found, "clean"):
        parts += ["Clean records that are given a name:",
                  level_table(levels(clean, "noise", noise, falsely_named))]  # fmt: skip
    if outside := [one for one in of_group(found, "outside") if one.nothing_like_it]:
        parts += ["A cause outside the library called `unnamed`:",
                  level_table(levels(outside, "cause", hidden, unnamed))]  # fmt: skip
    return [*parts, MISSES, miss_table(found)] if misses(found) else parts


def unnamed(one: Scored) -> bool:
    return one.said.verdict == "unnamed"


def families(found: Sequence[Scored]) -> dict[str, list[Scored]]:
    """The records that a model of the project predicts, by the first word of their group."""
    rest = [one for one in found if one.truth.group not in BENCH_GROUPS]
    names = dict.fromkeys(one.truth.group.rsplit(" ", 1)[0] for one in rest)
    return {name: [one for one in rest if one.truth.group.startswith(name)] for name in names}


def of_models(name: str, found: Sequence[Scored]) -> list[str]:
    """The figures of one namer on records that a model of the project predicts."""
    of = families(found)
    if not of:
        return []
    parts = [f"### {name} with the project's own models", figure_table(of)]
    rest = [one for same in of.values() for one in same]
    return [*parts, MISSES, miss_table(rest)] if misses(rest) else parts


def of_bench(answers: Answers) -> list[str]:
    """The figures of all namers on the records that need no model."""
    bench: dict[str, Sequence[Scored]] = {}
    for name, found in answers.items():
        if own := [one for one in found if one.truth.group in BENCH_GROUPS]:
            bench[name] = own
    if not bench:
        return []
    parts = ["### Figures", figure_table(bench)]
    if text := dominant_table(bench):
        parts += ["### Beside a dominant effect", text]
    return parts


def details(answers: Answers) -> str:
    """What the figures of all methods are made of, for the terminal."""
    parts = ["### Where the baselines fail", baseline_table(answers)] if set(answers) & set(BASELINES) else []
    for name, found in answers.items():
        if name not in BASELINES and (own := [one for one in found if one.truth.group in BENCH_GROUPS]):
            parts += in_detail(name, own)
    return "\n\n".join(parts)


def page(answers: Answers, seconds: Mapping[str, Sequence[float]], command: str) -> str:
    """All tables, under the command that made them."""
    more = (" In brackets the 95 % interval (of clean records 90 %: its upper end is the bound that is judged), then "
            "of how many records, or of how many effects given; of the baselines the value alone.")  # fmt: skip
    parts = [made_by(command, more), *of_bench(answers)]
    for name, found in answers.items():
        parts += of_models(name, found)
    return "\n\n".join([*parts, "### Time", "CPU seconds per record.", time_table(seconds)])


def newer_page(answers: Answers, command: str) -> str:
    """The figures of the newer groups, under the command that made them; the rest of the page says what they mean."""
    return f"{made_by(command)}\n\n{figure_table(answers)}"


def made_by(command: str, more: str = "") -> str:
    """The command that made tables, in lines of the documentation's width."""
    return fill(f"By `{command}`.{more}", 120, break_long_words=False, break_on_hyphens=False)


def ends_of(part: str) -> tuple[str, str]:
    """The lines between which a part of a page is."""
    return f"<!-- {part}: begin -->", f"<!-- {part}: end -->"


def parts_of(path: Path, part: str = MEASURED) -> tuple[str, str]:
    """What a page has before and after the tables of a part.

    Raises ValueError where it has no place for them, OSError where it cannot be read.
    """
    text, (first, last) = path.read_text(encoding="utf-8"), ends_of(part)
    before, begin, rest = text.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end:
        raise ValueError(f"{path}: needs a line {first} and after it a line {last}")
    return before, after


def written(path: Path, tables: str, part: str = MEASURED) -> None:
    """Puts tables between the lines of a part of a page; raises what `parts_of` does."""
    before, after = parts_of(path, part)
    first, last = ends_of(part)
    path.write_text(f"{before}{first}\n\n{tables}\n\n{last}{after}", encoding="utf-8")


def repeatable(argv: Sequence[str]) -> list[str]:
    """The arguments without those that are of one machine: where answers are kept, and workers."""
    own = ("--out", "--workers")
    return [
        one for at, one in enumerate(argv)
        if one not in own and (at == 0 or argv[at - 1] not in own)
    ]  # fmt: skip
