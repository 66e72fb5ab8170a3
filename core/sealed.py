"""Content that carries its own digest, so that damage is detected before it is used."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .files import write_text

MARK = b"\nsha256 "
"""Before the digest, which ends the content."""
KEY = "sha256"
"""Key of the digest of a record."""
LENGTH = len(MARK) + 64 + 1


def sealed(content: bytes) -> bytes:
    """The content with its SHA-256 at its end."""
    return content + _seal(content)


def unsealed(content: bytes) -> bytes:
    """What `sealed` was given. Raises ValueError where a byte is not as it was written."""
    body, seal = content[:-LENGTH], content[-LENGTH:]
    if not seal.startswith(MARK):
        raise ValueError("it is cut short, or of another version: it does not end with its digest")
    if seal != _seal(body):
        raise ValueError("it is damaged: its content does not fit its digest")
    return body


def sealed_record(record: Mapping[str, Any], of: str = "") -> dict[str, Any]:
    """A record of JSON values with its digest as the last entry, bound to the text `of`."""
    return {**record, KEY: digest_of(record, of)}


def unsealed_record(stored: Any, of: str = "") -> dict[str, Any]:
    """What `sealed_record` was given. Raises ValueError where a value is another."""
    if not isinstance(stored, dict) or KEY not in stored:
        raise ValueError("it is not a record with a digest")
    record = {name: value for name, value in stored.items() if name != KEY}
    if stored[KEY] != digest_of(record, of):
        raise ValueError("it is damaged: its content does not fit its digest")
    return record


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write a sealed record as a JSON file."""
    write_text(path, json.dumps(sealed_record(record), indent=1) + "\n")


def read_record(path: Path) -> dict[str, Any] | None:
    """What `write_record` was given, None where there is no file. Raises ValueError if damaged."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(error.strerror) from error
    return unsealed_record(loads(text))


def digest_of(record: Mapping[str, Any], of: str = "") -> str:
    """SHA-256 of a record of JSON values, whatever the order of its names."""
    text = json.dumps(record, sort_keys=True)
    return hashlib.sha256(f"{of}\n{text}".encode()).hexdigest()


def loads(text: str | bytes) -> Any:
    """A JSON value. Raises ValueError for any other text."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def _seal(body: bytes) -> bytes:
    return MARK + hashlib.sha256(body).hexdigest().encode() + b"\n"
