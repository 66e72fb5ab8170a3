"""A benchmark of naming what a simulation misses, and what is needed to judge any namer by it."""
