"""A section that a plugin adds to the page of a run: its base class, and those installed.

Plugins import this module: it loads nothing that draws.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from .records import RunResult
from .registry import Kinds


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


SECTIONS: Kinds[PageSection] = Kinds("pages")
"""The sections by name: entry points of `tolevo.pages`."""
