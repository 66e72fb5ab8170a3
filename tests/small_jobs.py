"""Small configurations that many tests run, and the command in the process of a test."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner, Result

from tolevo.cli import app

PART_A = """
[[part]]
name = "a"
nominal = 20.0
unit = "mm"
sensitivity = 1.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.75 }
"""
PART_B = """
[[part]]
name = "b"
nominal = 30.0
unit = "mm"
sensitivity = -2.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
"""
REQUIREMENT = """
[requirement]
name = "gap"
unit = "mm"
"""
RANDOM = """
[algorithm]
name = "random"
population = 20
generations = 6
"""
STACK = f"""
problem = "stack"
seed = 1
{REQUIREMENT}{PART_A}{RANDOM}"""
"""A stack of one part, searched at random."""
TWO_PARTS = f"""
problem = "stack"
seed = 1
{REQUIREMENT}{PART_A}{PART_B}{RANDOM}"""
HOUSING_AND_SHAFT = """
problem = "stack"
[requirement]
name = "gap"
unit = "mm"
lower = -0.2
upper = 0.2
[[part]]
name = "housing"
nominal = 55.29
unit = "mm"
sensitivity = 1.0
t_min = 0.003
t_max = 0.25
cost = { model = "reciprocal", a = 3.5, b = 0.75 }
[[part]]
name = "shaft"
nominal = 35.0
unit = "mm"
sensitivity = -1.0
t_min = 0.003
t_max = 0.25
cost = { model = "reciprocal", a = 2.0, b = 0.3 }
"""
"""A stack of two parts without an algorithm."""
POSE_BY_GA = """
problem = "pose_accuracy"
[parameters]
index = "rms_plane"
[objectives]
minimise = ["cost"]
[limits]
squareness_mrad = {mrad}
{more}
[algorithm]
name = "ga"
population = {population}
generations = {generations}
"""
"""The run of a study, to be filled in."""
GAP = """
model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
[effects]
consider = ["torsional_compliance", "lost_motion"]
[settings]
simulations = 200
bootstrap = 8
"""
CLAIMS = """
document = "X"
title = "A paper"
seed = 3
[[claim]]
id = "k1"
place = "page 1"
quantity = "k1"
printed = "0.8125"
unit = "1"
[[claim.reading]]
formula = "1.3 * 40 / 64"
"""
EXCEED = """
[[claim]]
id = "exceed"
place = "page 2"
quantity = "share above 1 arcmin"
printed = "0.11"
unit = "1"
tolerance = 0.05
tolerance_reason = "1000 units have a standard error of 0.01"
[[claim.reading]]
model = "rv_batch"
parameters = { model = "document", reading = "printed" }
units = 1000
output = "backlash_arcmin"
statistic = "fraction_above"
threshold = 1.0
"""
"""A claim of a share of simulated units."""


def tolevo(*words: object) -> Result:
    """The command in this process."""
    return CliRunner().invoke(app, [str(word) for word in words])


def output_of(*words: object) -> str:
    """What the command prints; it must end well."""
    ended = tolevo(*words)
    assert ended.exit_code == 0, ended.output
    return ended.output


def written(path: Path, text: str) -> Path:
    """A file with this text."""
    path.write_text(text, encoding="utf-8")
    return path
