"""`python -m benchmarks.promise`: shares of promises kept, from samples of 10, 20 and 50 parts.

Of assured promises (95 %) the lower 95 % limit of the share must be 91 % at least, the share of
nine equal parts 99 % at most, and their costs 1.42, 1.21 and 1.10 of the plug-in's at most.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .cases import Case, cases
from .repeated import Repeated, lowest, parser
from .repeats import SHARE, Repeat, repeat

LEAST, MOST = 91.0, 99.0
COSTS = {10: 1.42, 20: 1.21, 50: 1.10}


def main(arguments: Sequence[str] | None = None) -> None:
    """Repeat every case, and print the table."""
    given = parser(__doc__, "promise").parse_args(arguments)
    repeats, rows = Repeated(given.kept, repeat, Repeat), []
    for case in (one for one in cases() if one.n in given.n):
        rows.append((case, repeats.each(case, range(given.seed, given.seed + given.count))))
        print(row(*rows[-1]), flush=True)
    print(f"\n{table(rows)}")


def table(rows: Sequence[tuple[Case, Sequence[Repeat]]]) -> str:
    """A line for each case, and what was promised."""
    head = ("| stack | plug-in kept | assured kept | lower 95 % limit | cost | largest gap |\n"
            "|---|---:|---:|---:|---:|---:|")  # fmt: skip
    missed = [case.key for case, own in rows if not kept_well(case, own)]
    verdict = f"MISSED in {', '.join(missed)}" if missed else "met"
    return "\n".join([head, *(row(*one) for one in rows), "", f"Promised: {verdict}."])


def row(case: Case, own: Sequence[Repeat]) -> str:
    """The line of one case."""
    plain, share, low, cost = figures(own)
    return (f"| {case.key} | {plain:.1f} % | {share:.1f} % | {low:.1f} % | {cost:.3f} "
            f"| {100.0 * max(one.gap for one in own):.1e} % |")  # fmt: skip


def figures(own: Sequence[Repeat]) -> tuple[float, float, float, float]:
    """Shares kept by plug-in and assured, the latter's lower limit, relative cost (mean)."""
    kept = sum(one.assured_yield >= SHARE for one in own)
    plain = sum(one.plug_in_yield >= SHARE for one in own)
    cost = float(np.mean([one.assured / one.plug_in for one in own]))
    share = 100.0 * kept / len(own)
    return 100.0 * plain / len(own), share, lowest(kept, len(own)), cost


def kept_well(case: Case, own: Sequence[Repeat]) -> bool:
    """Whether a case keeps what is promised of it."""
    _, share, low, cost = figures(own)
    dear = case.parts == 9 and not (case.uneven or case.prior or case.as_found)
    return low >= LEAST and (not dear or (share <= MOST and cost <= COSTS[case.n]))


if __name__ == "__main__":
    main()
