"""Files of claims: every fault placed, nothing written; tolerances from the printed digits."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.reproduce.claims import Claim
from tolevo.commands.reproduce.configuration import read_claims, shipped_claims
from tolevo.errors import InputError

HEAD = 'document = "X"\ntitle = "A paper"\n'
CLAIM = """
[[claim]]
id = "a"
place = "page 1"
quantity = "k1"
printed = "0.8125"
unit = "1"
[[claim.reading]]
formula = "1.3 * 40 / 64"
"""


STUDY = """algorithm.population,replicate,status,gap_percent,evaluations_to_99
80,0,done,0.1,100
80,1,done,0.2,100
20,0,done,0.3,100
20,1,done,0.4,100
"""


def file(folder: Path, text: str, name: str = "paper.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def claim(folder: Path, text: str) -> Claim:
    (source,) = read_claims([file(folder, HEAD + text)]).sources
    (found,) = source.file.claims
    return found


def reading(lines: str, unit: str = "1", printed: str = "1") -> str:
    """A file of one claim that is recomputed as `lines` say."""
    return HEAD + CLAIM.replace('formula = "1.3 * 40 / 64"', lines).replace(
        'unit = "1"', f'unit = "{unit}"'
    ).replace('printed = "0.8125"', f"printed = {printed}")  # fmt: skip


@pytest.mark.parametrize(
    ("printed", "tolerance"),
    [
        ('"0.8125"', 5e-5), ("0.8125", 5e-5), ('"-0.040"', 5e-4), ("-0.04", 5e-3), ("12", 0.5),
        ('"40"', 0.5), ("2.0", 0.5), ('"2.0"', 0.05), ('["1.71", "2.6"]', 0.05), ('"1e-3"', 5e-4),
    ],
)  # fmt: skip
def test_tolerance_is_half_a_unit_of_the_last_printed_digit(printed: str, tolerance: float, tmp_path: Path) -> None:
    text = CLAIM.replace('"0.8125"', printed)
    if printed.startswith("["):
        text = text.replace('formula = "1.3 * 40 / 64"', 'formula = ["1", "2"]')
    found = claim(tmp_path, text)
    assert found.tolerance == pytest.approx(tolerance)
    assert found.tolerance_reason


@pytest.mark.parametrize("relation", ["at_least", "at_most", "above", "below"])
def test_other_relations_have_no_tolerance_of_their_own(relation: str, tmp_path: Path) -> None:
    text = CLAIM.replace('unit = "1"', f'unit = "1"\nrelation = "{relation}"')
    assert claim(tmp_path, text).tolerance == 0.0


FAULTS = {
    "missing unit": (
        HEAD + CLAIM.replace('unit = "1"\n', ""),
        'claim[0] (a).unit: is missing: write the unit of the printed value, "1" where it has none',
    ),
    "unknown unit": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "parsnip"'),
        'claim[0] (a).unit: "parsnip" is not',
    ),
    "no number": (
        HEAD + CLAIM.replace('"0.8125"', '"about 1"'),
        "claim[0] (a).printed: must be a number, or its digits as a string",
    ),
    "no number in a pair": (
        HEAD + CLAIM.replace('"0.8125"', '[1, "x"]'), "claim[0] (a).printed[1]: must be a number",
    ),
    "infinite": (HEAD + CLAIM.replace('"0.8125"', "inf"), "claim[0] (a).printed: must be a number"),
    "unjustified tolerance": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\ntolerance = 9.0'),
        "claim[0] (a).tolerance_reason: is missing: a tolerance needs its justification",
    ),
    "empty justification": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\ntolerance = 9.0\ntolerance_reason = " "'),
        "claim[0] (a).tolerance_reason: is missing",
    ),
    "tolerance of an order": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\nrelation = "above"\ntolerance = 0.1\n'
                             'tolerance_reason = "x"'),
        'claim[0] (a).tolerance: has no meaning with relation = "above"',
    ),
    "unknown key": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\ntolerence = 9.0'),
        "claim[0] (a).tolerence: is not a known key (did you mean `tolerance`?)",
    ),
    "same id": (HEAD + 2 * CLAIM, 'claim[1] (a).id: "a" is also the id of claim[0]'),
    "no reading": (
        HEAD + CLAIM[: CLAIM.index("[[claim.reading]]")], "claim[0] (a).reading: is missing",
    ),
    "lost and computed": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\nlost = "a table"'),
        "claim[0] (a).reading: computes what `lost` states to be impossible",
    ),
    "unstated second reading": (
        HEAD + CLAIM + '[[claim.reading]]\nformula = "1"\n',
        "claim[0] (a).reading[1].states: is missing: only the first interpretation may be the literal one",
    ),
    "range of one": (
        HEAD + CLAIM.replace('unit = "1"', 'unit = "1"\nrelation = "within"'),
        "claim[0] (a).printed: must be [low, high]",
    ),
    "nothing to compute by": (
        reading('quantity = "x"'), "claim[0] (a).reading[0]: must have exactly one of the keys",
    ),
    "unknown model": (
        reading('model = "rv_bach"\nunits = 10\noutput = "backlash_arcmin"\nstatistic = "mean"'),
        'reading[0].model: "rv_bach" is not an installed model (did you mean `rv_batch`?)',
    ),
    "unknown problem": (
        reading('problem = "rv_backlsh"\noutput = "cost"'),
        '"rv_backlsh" is not an installed problem (did you mean `rv_backlash`?)',
    ),
    "unknown calculation": (
        reading('calculation = "task_rng"\nquantity = "length_mm"'),
        '"task_rng" is not an installed calculation (did you mean `task_ring`?)',
    ),
    "unknown quantity": (
        reading('calculation = "task_ring"\nquantity = "lenght_mm"'),
        'reading[0].quantity: "lenght_mm" is not computed (did you mean `length_mm`?)',
    ),
    "quantity of another unit": (
        reading('calculation = "task_ring"\nquantity = "length_mm"', unit="kg"),
        'reading[0]: calculation task_ring: "mm" is not a unit that can be stated in kg',
    ),
    "parameter out of range": (
        reading('calculation = "backlash_stages"\nquantity = "output_std_arcmin"\n'
                "parameters = { crank_bearing_um = -1.0 }", unit="arcmin"),
        "reading[0].parameters.crank_bearing_um: must lie in [0, 1000], got -1",
    ),
    "setting out of range": (
        reading('calculation = "ga_settings"\nquantity = "seeds"\n'
                'parameters = { setting = "mutation", a = 1.5, b = 0.1 }'),
        "reading[0].parameters.a: a probability must lie in [0, 1], got 1.5",
    ),
    "units missing": (
        reading('model = "rv_batch"\noutput = "backlash_arcmin"\nstatistic = "mean"', "arcmin"),
        "reading[0].units: is missing: rv_batch draws units; state their number",
    ),
    "statistic missing": (
        reading('model = "rv_batch"\noutput = "backlash_arcmin"\nunits = 10', "arcmin"),
        "reading[0].statistic: is missing: there are 10 rows",
    ),
    "threshold missing": (
        reading('model = "rv_batch"\noutput = "backlash_arcmin"\nunits = 10\n'
                'statistic = "fraction_above"'),
        "reading[0].threshold: is missing",
    ),
    "operating point missing": (
        reading('model = "assembly"\noutput = "delta_1_mrad"\n'
                "at = { dtheta_1_mrad = 1.0 }", "mrad"),
        "reading[0].at.dtheta_2_mrad: is missing: angular error of gear 1 before assembly",
    ),
    "unknown reference": (
        reading('problem = "rv_backlash"\nreference = "document C"\noutput = "cost"'),
        "reading[0].reference: must be one of document B, document B, staggered 0.2 arcmin",
    ),
    "design out of range": (
        reading('problem = "rv_backlash"\noutput = "cost"\ndesign = { pin_radius_um = -1.0 }'),
        "reading[0].design.pin_radius_um: must lie in [0, 1000], got -1",
    ),
    "derivative by nothing": (
        reading('problem = "rv_backlash"\noutput = "phi_2_arcmin"\n'
                'derivative = { by = "staggr_arcmin", step = 0.1 }'),
        '"staggr_arcmin" is not an input of problem rv_backlash (did you mean `stagger_arcmin`?)',
    ),
    "derivative without a step": (
        reading('problem = "rv_backlash"\noutput = "phi_2_arcmin"\n'
                'derivative = { by = "stagger_arcmin" }'),
        "reading[0].derivative.step: is missing",
    ),
    "bad formula": (reading('formula = "1 +"'), 'reading[0].formula: "1 +": '),
    "unknown term": (reading('formula = "2 * x"'), 'reading[0].formula: "x" is not a term'),
    "term without unit": (
        reading('formula = "x"\n[claim.reading.terms]\nx = { value = 1.0 }'),
        "reading[0].terms.x.unit: is missing",
    ),
    "too many quantities": (
        reading('formula = ["1", "2"]'),
        "reading[0].formula: must hold 1 formulas, as many as `printed` has numbers, got 2",
    ),
    "no title": ('document = "X"\n' + CLAIM, "title: is missing"),
    "no claims": (HEAD, "claim: is missing"),
}  # fmt: skip


@pytest.mark.parametrize("case", FAULTS)
def test_faults_are_placed_and_nothing_is_written(case: str, tmp_path: Path) -> None:
    text, said = FAULTS[case]
    path, out = file(tmp_path, text), tmp_path / "out"
    found = CliRunner().invoke(app, ["reproduce", str(path), "--out", str(out)])
    assert found.exit_code == 2
    lines = found.stderr.splitlines()
    assert any(line.startswith("paper.toml: ") and said in line for line in lines), lines
    assert not out.exists()


def test_all_faults_of_all_files_at_once(tmp_path: Path) -> None:
    first = file(tmp_path, HEAD + CLAIM.replace('unit = "1"\n', ""), "one.toml")
    second = file(tmp_path, HEAD + CLAIM.replace('"0.8125"', "true"), "two.toml")
    with pytest.raises(InputError) as error:
        read_claims([first, second, tmp_path / "three.toml"])
    places = [fault.place for fault in error.value.faults]
    assert "one.toml: claim[0] (a).unit" in places
    assert "two.toml: claim[0] (a).printed" in places
    assert "two.toml: document" in places  # both are document X
    assert str(tmp_path / "three.toml") in places


def test_seed_and_study_may_be_set(tmp_path: Path) -> None:
    text = reading('calculation = "ga_settings"\nquantity = "seeds"')
    (tmp_path / "study.csv").write_text(STUDY, encoding="utf-8")
    plan = read_claims([file(tmp_path, text)], ["seed=7", f"study={tmp_path}"])
    assert plan.sources[0].file.seed == 7
    recipe = plan.sources[0].file.claims[0].interpretations[0].recipe
    assert recipe.recomputed(np.random.default_rng(0)).quantities[0].value == 2.0
    with pytest.raises(InputError, match=r"parameters.study: .* does not exist: name the dir"):
        read_claims([file(tmp_path, text)], ["study=nowhere"])
    with pytest.raises(InputError, match="sead: is not a known key"):
        read_claims([file(tmp_path, text)], ["sead=7"])


def test_shipped_files_are_read_and_name_what_is_asked_for() -> None:
    plan = read_claims(())
    names = {source.file.document.name: source.file for source in plan.sources}
    assert [path.name for path in shipped_claims()] == [f"claims_{name}.toml" for name in "abm"]
    assert list(names) == ["A", "B", "M"]
    for own in names.values():
        for one in own.claims:
            assert one.unit
            assert one.place
            assert bool(one.interpretations) is not bool(one.lost)
            assert one.tolerance == 0.0 or one.tolerance_reason
    sensitivities = [one for one in names["B"].claims if one.id.startswith("sensitivity-")]
    assert len(sensitivities) == 10
