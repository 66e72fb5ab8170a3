"""The `tolevo` command, also as `python -m tolevo`: interrupts are heard before anything is loaded."""

from __future__ import annotations

import gc

from .interrupts import listen

GARBAGE = 50_000
"""New objects between two searches for cycles: imports make many objects and no garbage, compiling makes much."""


def main() -> None:
    """Entry point of the command."""
    listen()
    gc.set_threshold(GARBAGE)
    from .cli import main as command

    command()


if __name__ == "__main__":
    main()
