"""Tables, formulas and units damaged at random: faults, never a traceback, a hang or a file.

How many of each: `tests/fuzzing.py`. Configurations, checkpoints and databases have tests of their
own: test_mutated_configurations, test_damaged_checkpoints, test_damaged_states.
"""

from __future__ import annotations

import io
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.fuzzing import HANG, SEED, Hang, TooLarge, guarded, share
from tolevo.cli import app
from tolevo.models.expressions import Formula, FormulaError
from tolevo.units import to_unit

CHUNKS = 4
SIGNS = ("\x00", "\ufeff", "\u202e", "nan", "inf",
         *"0123456789.,;:-+eE'\"\t\n\r =@#%&|/\\()[]{}<>_^*°µ\u2032ä")  # fmt: skip
FORMULAS = (
    "acos((hub + (roller_1 + roller_2)/2) / (cage - (roller_1 + roller_2)/2))",
    "a*sin(b)**2 + sqrt(c) - exp(-d/2) / log(e + 1)",
    "((a + b) * (c - d))**2 / (1e-3 + abs(e))",
    "min(a, b, max(c, 2.5e-7)) + pi*atan2(d, e)",
)
UNITS = ("2 um", "15 1/min", "58.5 Nm/'", "11.5 um/(m K)", "2 kg cm^2", "90 km/h", "5 arcmin/(N m)", "3 mrad**2")
OF_UNITS = ("um", "rpm", "Nm_per_arcmin", "1/K", "kg m^2", "m/s", "arcsec/Nm", "mrad**2", "percent")


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """Bytes flipped, cut, doubled, swapped or put in, one to four times."""
    for _ in range(1 + rng.integers(4)):
        at, size = int(rng.integers(len(whole) + 1)), int(rng.integers(1, 40))
        sign = SIGNS[rng.integers(len(SIGNS))].encode()
        flipped = bytes([rng.integers(256)])
        new = (b"", whole[at : at + size] * 2, sign, flipped, sign * 300, whole[at : at + size][::-1])
        whole = whole[:at] + new[rng.integers(len(new))] + whole[at + size :]
    return whole or b"\n"


def text_of(text: str, rng: np.random.Generator) -> str:
    return damaged(text.encode(), rng).decode("utf-8", "replace")


def tables(rng: np.random.Generator) -> tuple[pd.DataFrame, str]:
    """A table of readings, and the line ends and signs that it is written with."""
    rows = int(rng.integers(1, 30))
    frame = pd.DataFrame({
        "unit": rng.choice(["a", "=b", "007", "12 mm"], rows),
        **{f"dtheta_{at}_mrad": rng.uniform(-0.3, 0.3, rows).round(3) for at in range(1, 5)},
        "precision_weight": rng.choice([0.5, 1.0], rows),
    })  # fmt: skip
    separator = ",;\t"[rng.integers(3)]
    text = frame.to_csv(index=False, sep=separator, decimal=",."[int(separator == ",")])
    return frame, text


def outcome(folder: Path, name: str, content: bytes) -> str:
    """What is wrong with how `simulate` takes a table; empty where it is taken or refused."""
    out = folder / "out.csv"
    out.unlink(missing_ok=True)
    (folder / name).write_bytes(content)
    words = ["simulate", str(folder / "c.toml"), str(folder / name), "--out", str(out)]
    try:
        with guarded(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ended = CliRunner().invoke(app, words)
    except Hang:
        return f"hangs for more than {HANG} s"
    except TooLarge as error:
        return f"takes {error}"
    if ended.exception is not None and not isinstance(ended.exception, SystemExit):
        return "".join(traceback.format_exception(ended.exception))
    if ended.exit_code not in (0, 2) or "Traceback" in ended.stderr:
        return f"status {ended.exit_code}: {ended.stderr}"
    if (ended.exit_code == 0) != out.is_file():
        return f"status {ended.exit_code}, and out.csv is{'' if out.is_file() else ' not'} there"
    return ""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "c.toml").write_text('model = "assembly"\n', encoding="utf-8")
    return tmp_path


def as_csv(rng: np.random.Generator) -> bytes:
    return tables(rng)[1].encode("utf-8" if rng.random() < 0.8 else "utf-16")


def as_parquet(rng: np.random.Generator) -> bytes:
    file = io.BytesIO()
    tables(rng)[0].to_parquet(file, index=False)
    return file.getvalue()


@pytest.mark.parametrize("chunk", range(CHUNKS))
@pytest.mark.parametrize(("name", "made", "percent"), [("t.csv", as_csv, 14), ("t.parquet", as_parquet, 6)])
def test_a_damaged_table_is_refused_or_taken(
    folder: Path, name: str, made: Callable[[np.random.Generator], bytes], percent: int, chunk: int
) -> None:
    bad = []
    for number in range(chunk, share(percent), CHUNKS):
        rng = np.random.default_rng((SEED, 2, percent, number))
        content = damaged(made(rng), rng)
        if wrong := outcome(folder, name, content):
            bad.append(f"table {number}: {wrong}\n{content[:1500]!r}")
    assert not bad, f"{len(bad)}:\n" + "\n\n".join(bad[:5])


def test_what_is_damaged_is_taken_whole(folder: Path) -> None:
    for name, made in (("t.csv", as_csv), ("t.parquet", as_parquet)):
        assert outcome(folder, name, made(np.random.default_rng(1))) == ""
        assert (folder / "out.csv").is_file()


def test_what_is_fuzzed_is_valid() -> None:
    assert all(Formula(text).names for text in FORMULAS)
    for text, unit in zip(UNITS, OF_UNITS, strict=False):
        assert np.isfinite(to_unit(text, unit))


def test_a_fuzzed_formula_is_refused_or_evaluated() -> None:
    values = {name: np.array([0.5, 1.5]) for name in ("hub", "roller_1", "roller_2", "cage", *"abcde")}
    taken = 0
    for number in range(share(10)):
        rng = np.random.default_rng((SEED, 3, number))
        text = text_of(FORMULAS[rng.integers(len(FORMULAS))], rng)
        with guarded(), np.errstate(all="ignore"), suppress(FormulaError):
            formula = Formula(text)
            taken += 1
            if set(formula.names) <= set(values):
                found = formula.value({name: values[name] for name in formula.names})
                assert np.shape(found) in ((), (2,)), text
    assert taken < share(10)


def test_a_fuzzed_unit_is_refused_or_a_finite_number() -> None:
    for number in range(share(8)):
        rng = np.random.default_rng((SEED, 4, number))
        text = text_of(UNITS[rng.integers(len(UNITS))], rng)
        with guarded(), suppress(ValueError):
            assert np.isfinite(to_unit(text, OF_UNITS[rng.integers(len(OF_UNITS))])), text
