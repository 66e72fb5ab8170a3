"""From the runs of a study to its statistics."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pandas as pd

from ....records import Response, StudyResult, Varied
from ..records import LARGER_IS_BETTER, StudyData, StudySettings
from .contrasts import contrasts
from .courses import courses
from .hypotheses import verdicts
from .medians import medians
from .pairs import ALPHA, pairs_needed
from .recommendation import recommendation
from .runs import Runs, runs_of
from .sensitivity import sensitivity
from .tested import tests

BEST = MappingProxyType({"hypervolume_ratio": 1.0, "gap_percent": 0.0, "feasible_fraction": 1.0})
"""The best value of a response that there can be."""
FAILED = (
    "{failed} of {total} runs failed. A failed run is left out together with the runs of its seed that it would be "
    "compared with: in a test the pair, in Friedman's and the analysis of variance the seed, in a Sobol block or a "
    "Morris step the seed in that block or step; a recommendation counts it as the worst"
)


def analyse(settings: StudySettings, data: StudyData, rng: np.random.Generator) -> StudyResult:
    """All statistics of a finished study; the same data and generator give the same result."""
    design = data.design.reset_index(drop=True)
    keys = [factor.key for factor in settings.factors]
    key_contrasts = contrasts(settings.design.analysis, design, settings.factors, settings.base)
    responses = tuple(Response(name, name in LARGER_IS_BETTER, BEST.get(name)) for name in settings.responses)
    all_runs = [runs_of(data.table, name, len(design)) for name in settings.responses]
    tested = _joined([tests(runs, design, settings, key_contrasts, rng) for runs in all_runs])
    alone = key_contrasts if settings.design.analysis == "one_at_a_time" else []
    return StudyResult(
        title=settings.title,
        kind=settings.design.kind,
        design=design[keys],
        table=data.table,
        responses=responses,
        varied=tuple(
            Varied(factor.key, settings.base.get(factor.key), factor.categorical, factor.log)
            for factor in settings.factors
        ),
        medians=_joined([medians(runs, rng) for runs in all_runs]),
        sensitivity=_joined([sensitivity(runs, design, settings, key_contrasts, rng) for runs in all_runs]),
        tests=tested,
        courses=courses(data, alone, rng),
        course_of=settings.objectives[0] if len(settings.objectives) == 1 else "hypervolume",
        recommendations=tuple(
            recommendation(runs, design, settings.base, response, rng)
            for runs, response in zip(all_runs, responses, strict=True)
        ),
        verdicts=verdicts(settings.hypotheses, tested),
        notes=(*data.notes, *_notes(settings, data.table, all_runs, tested)),
        configuration=settings.configuration,
        mechanism=settings.labels.stated(),
    )


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    full = [part for part in parts if len(part)]
    return pd.concat(full, ignore_index=True) if full else parts[0]


def _notes(settings: StudySettings, table: pd.DataFrame, all_runs: list[Runs], tested: pd.DataFrame) -> list[str]:
    """What the reader must know: failures, what is left out and why."""
    notes = []
    failed = int((table["status"] == "failed").sum())
    if failed:
        notes.append(FAILED.format(failed=failed, total=len(table)))
    for runs in all_runs:
        if not runs.reached:
            count = int(np.isinf(runs.array).sum())
            notes.append(
                f"{runs.response}: {count} of {runs.array.size} runs did not reach it within the budget of their "
                "setting; they count as worse than all others in ranks, and the response has no variance to divide"
            )
    if settings.seeds < 2:
        notes.append("one seed per setting: noise and effects are confounded, and nothing is tested")
    pairs = tested[tested["kind"] == "wilcoxon"] if len(tested) else tested
    counts = pairs.groupby("response").size() if len(pairs) else pd.Series(dtype=int)
    needed = max((pairs_needed(int(count)) for count in counts), default=0)
    if settings.seeds < needed:
        text = f"{settings.seeds} seeds cannot show a difference at p = {ALPHA} among so many comparisons"
        notes.append(f"{text}: {needed} can")
    return notes
