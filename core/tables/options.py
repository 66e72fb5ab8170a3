"""What the user states about a file, so that nothing has to be detected."""

from __future__ import annotations

import codecs
from dataclasses import dataclass

from ..errors import Fault

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "\\t": "\t", "pipe": "|", "bar": "|", "space": " "}
"""Words for a delimiter, as a command line is typed."""
KNOWN = (",", ";", "\t", "|", " ")
NAMES = {",": "comma", ";": "semicolon", "\t": "tab", "|": "pipe", " ": "space", "": "none"}


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Encoding, delimiter and decimal sign of a text file; None where it is to be detected."""

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None

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


def _is_codec(name: str) -> bool:
    """Whether a name is that of an encoding of text."""
    try:
        "".encode(codecs.lookup(name).name)
    except (LookupError, ValueError):
        return False
    return True
