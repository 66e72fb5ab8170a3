"""Rooms of code that makes numbers, and the tests by which their mutants are tried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class Room:
    """Modules (patterns of files) and their tests; of proofs every guard is tried."""

    files: tuple[str, ...]
    tests: tuple[str, ...]
    guards: bool = False

    def sources(self) -> list[str]:
        """The files of its modules, without packages' doors."""
        paths = (path for pattern in self.files for path in sorted(ROOT.glob(pattern)))
        return [str(path.relative_to(ROOT)) for path in paths if path.name != "__init__.py"]

    def tests_of(self) -> list[str]:
        """The files of its tests that are there."""
        paths = (path for one in self.tests for path in sorted(ROOT.glob(one)))
        return [str(path.relative_to(ROOT)) for path in paths]


PROVE = ("bounds", "combination", "choices", "separable", "programme")
"""Modules of algorithms/exact/ that a bound comes from; the others propose points."""
ROOMS: Mapping[str, Room] = {
    "proofs": Room(
        tuple(f"algorithms/exact/{name}.py" for name in PROVE),
        tuple(f"tests/algorithms/exact/test_{name}.py" for name in (
            "between", "bounds", "choices", "choices_guards", "choices_prices",
            "combination_guards", "doubt", "doubt_guards", "duals", "master", "master_guards",
            "master_search", "oracle", "path", "prices_guards", "programme", "programme_by_hand",
            "separable", "separable_guards", "ascent")),
        guards=True,
    ),
    "exact": Room(
        ("algorithms/exact/*.py",),
        ("tests/algorithms/exact/test_*.py", "tests/problems/test_stack_*.py",
         "tests/problems/test_rv_backlash_quantile.py"),
    ),
    "propagation": Room(
        ("models/propagation/*.py",),
        tuple(f"tests/models/test_{name}.py" for name in (
            "propagation", "propagation_series", "power_sums", "symmetric_sum",
            "sums_of_every_input")),
    ),
    "rv_reducer": Room(
        ("models/rv_reducer/*.py",),
        ("tests/models/test_rv_*.py", "tests/models/test_stagger.py",
         "tests/models/test_tighter_planet.py", "tests/models/test_tooth_fit.py",
         "tests/models/test_zone_optimum.py", "tests/models/test_gear.py"),
    ),
    "manipulator": Room(
        ("models/manipulator/*.py",),
        ("tests/models/test_manipulator*.py", "tests/models/effects/test_manipulator.py"),
    ),
    "contact": Room(
        ("models/rv_reducer/contact/*.py",),
        ("tests/models/test_rv_contact*.py", "tests/models/test_rv_batch_contact.py"),
    ),
    "expressions": Room(
        ("models/expressions.py",),
        ("tests/models/test_expressions.py", "tests/problems/test_stack_domain.py"),
    ),
    "study statistics": Room(
        tuple(f"tolevo/commands/study/{name}.py" for name in ("statistics", "sensitivity", "analysis")),
        tuple(f"tests/commands/study/test_{name}.py" for name in (
            "analysis", "comparisons", "sensitivity", "statistics_by_hand")),
    ),
    "gap selection": Room(
        ("tolevo/commands/gap/selection.py", "tolevo/commands/gap/analysis.py", "tolevo/commands/gap/scan.py"),
        tuple(f"tests/commands/test_gap_{name}.py" for name in (
            "statistics", "settled", "terms", "noise", "bounds", "arts", "counterparts",
            "selection_by_hand", "settling_by_hand")),
    ),
}  # fmt: skip
