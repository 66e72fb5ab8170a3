"""A section that a plugin adds to the page of a run: its base class, and those installed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import ClassVar

from ..errors import InputError
from ..records import RunResult
from ..registry import PLUGIN_FAULTS, Kinds, origin
from .document import section


class PageSection(ABC):
    """A section of the page of a run, between the choices and the references."""

    title: ClassVar[str]
    """Its heading, plain text."""

    @abstractmethod
    def body(self, result: RunResult) -> str:
        """HTML below the heading, empty where the section has nothing to show for this run.

        Texts from outside are to be escaped (`html.escape`). The page loads nothing from elsewhere
        and runs no script of a section.
        """


SECTIONS: Kinds[PageSection] = Kinds("pages", PageSection)
"""The sections by name: entry points of `tolevo.pages`."""


def plugin_sections(result: RunResult) -> tuple[str, ...]:
    """The sections of plugins; one that fails says so with its name and its reason."""
    return tuple(one for name in SECTIONS if (one := _section(name, result)))


def _section(name: str, result: RunResult) -> str:
    try:
        own = SECTIONS[name]()
        body = own.body(result)
        return section(own.title, str(body)) if body else ""
    except InputError as error:
        reason = "; ".join(fault.message for fault in error.faults)
    except PLUGIN_FAULTS as error:
        reason = f"{type(error).__name__}: {error}"
    text = f'The section "{name}" of {origin("pages", name)} is left out: {reason}'
    return section(name, f"<p>{escape(text)}</p>")
