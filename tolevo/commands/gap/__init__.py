"""`tolevo gap`: find where simulation and measurement disagree, identify the effect, close the gap."""
