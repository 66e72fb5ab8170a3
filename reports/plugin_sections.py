"""The sections of plugins on the page of a run; a section that fails states the reason."""

from __future__ import annotations

from html import escape

from ..errors import InputError
from ..page_section import SECTIONS
from ..records import RunResult
from ..registry import PLUGIN_FAULTS, origin
from .document import section


def plugin_sections(result: RunResult) -> tuple[str, ...]:
    """The sections of plugins; a section that fails shows its name and the reason."""
    return tuple(html for name in SECTIONS if (html := _section(name, result)))


def _section(name: str, result: RunResult) -> str:
    try:
        plugin = SECTIONS[name]()
        body = plugin.body(result)
        return section(plugin.title, str(body)) if body else ""
    except InputError as error:
        reason = "; ".join(fault.message for fault in error.faults)
    except PLUGIN_FAULTS as error:
        reason = f"{type(error).__name__}: {error}"
    text = f'The section "{name}" of {origin("pages", name)} is omitted: {reason}'
    return section(name, f"<p>{escape(text)}</p>")
