"""The `tolevo` command, also as `python -m tolevo`: interrupts are heard before anything is loaded."""

from __future__ import annotations

from .interrupts import listen


def main() -> None:
    """Entry point of the command."""
    listen()
    from .cli import main as command

    command()


if __name__ == "__main__":
    main()
