"""What the user states about a file, so that nothing has to be detected."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..errors import Fault

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "\\t": "\t", "pipe": "|", "bar": "|", "space": " "}
"""Words for a delimiter, as a command line is typed."""
KNOWN = (",", ";", "\t", "|", " ")
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "pipe", " ": "space", "": "none"}


OF_COMMANDS, KEYS, NONE = "options", "keys", "none"
"""Where the user states encoding, delimiter and decimal sign: options of a command, keys of the table
of a configuration that names the file, or nowhere, so that the file has to be written otherwise.
"""
_OPTION = re.compile(r"--(encoding|delimiter|decimal)(?: ([.,]))?")
_REMEDY = re.compile(r"[:;,]? state (?:another )?--.*")


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Encoding, delimiter and decimal sign of a text file; None where it is to be detected.

    `sizes` are nominal sizes and their units by the name of a column, that of "" counts for every
    column: where "68,001" can be 68.001 or 68001, the value near the nominal is meant.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    where: str = OF_COMMANDS
    sizes: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    def worded(self, fault: Fault) -> Fault:
        """A fault with the options named as the user states them."""
        if self.where == OF_COMMANDS:
            return fault
        message = fault.message
        if self.where == NONE:
            message = _REMEDY.sub("; save it in UTF-8 with semicolons between columns and decimal points", message)
        message = _OPTION.sub(lambda match: match[1] + (f' = "{match[2]}"' if match[2] else ""), message)
        return replace(fault, place=fault.place.removeprefix("--"), message=message)

    @property
    def separator(self) -> str | None:
        """The delimiter as a character."""
        return None if self.delimiter is None else DELIMITERS.get(self.delimiter, self.delimiter)

    def faults(self) -> list[Fault]:
        """A fault for every option that is not valid."""
        wrong = []
        if self.encoding is not None and not _is_codec(self.encoding):
            text = f'must be an encoding such as utf-8, cp1252, gbk or big5, got "{self.encoding}"'
            wrong.append(Fault("--encoding", text))
        if self.delimiter is not None and self.separator not in KNOWN:
            text = f'must be one of comma, semicolon, tab, pipe, space, got "{self.delimiter}"'
            wrong.append(Fault("--delimiter", text))
        if self.decimal is not None and self.decimal not in (".", ","):
            wrong.append(Fault("--decimal", f'must be "." or ",", got "{self.decimal}"'))
        return wrong


AS_DETECTED = ReadOptions()
NO_OPTIONS = ReadOptions(where=NONE)
"""For a file of which nothing can be stated."""


def _is_codec(name: str) -> bool:
    """Whether a name is that of an encoding of text."""
    try:
        "".encode(codecs.lookup(name).name)
    except (LookupError, ValueError):
        return False
    return True
