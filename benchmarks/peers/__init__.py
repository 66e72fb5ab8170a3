"""Contenders, one a module: DISTRIBUTION, LABEL and `run(recorder, seed, budget)`.

`run` evaluates through the recorder only and returns the front that a user is handed, (k, 2).
A module may say which tasks it takes, `suits(task)`, and how often a run is measured, `REPEATS`.
"""
