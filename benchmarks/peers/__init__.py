"""Contenders, one a module: DISTRIBUTION, LABEL and `run(recorder, seed, budget)`.

`run` evaluates through the recorder only and returns the front that a user is handed, (k, 2).
"""
