"""One optimisation: search, reported front, references, files."""
