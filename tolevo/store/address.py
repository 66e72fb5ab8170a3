"""Where a shared store lies, as users write it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlencode, urlsplit, urlunsplit

SCHEMES = ("postgresql", "postgres")
SCHEMA = "tolevo"
"""Schema of a database where an address names none."""
SECRETS = ("password", "sslpassword")
NAME = re.compile(r"[a-z_][a-z0-9_]{0,62}")
FORM = "postgresql://user@host:5432/database?schema=name"


@dataclass(frozen=True, slots=True)
class Address:
    """A schema of a PostgreSQL database. `url` is what libpq takes, `shown` has no secret."""

    url: str
    schema: str
    shown: str


def read_address(text: str) -> Address:
    """The address that a text is. Raises ValueError, whose text repeats no password."""
    try:
        parts = urlsplit(text)
        query = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
        secret = parts.password is not None or any(key in SECRETS for key, _ in query)
        _ = parts.port
    except ValueError:
        raise ValueError(f"is not the address of a database: write {FORM}") from None
    if parts.scheme not in SCHEMES:
        raise ValueError(f"must begin with postgresql://: write {FORM}")
    if secret:
        raise ValueError(
            "has a password in it: take it out, and give it by the environment "
            "(PGPASSWORD) or a file that only you can read (~/.pgpass)"
        )
    schemas = [value for key, value in query if key == "schema"]
    schema = schemas[-1] if schemas else SCHEMA
    if not NAME.fullmatch(schema):
        raise ValueError(f'schema must be small letters, digits and _, got "{schema}"')
    others = [(key, value) for key, value in query if key != "schema"]
    base = urlunsplit(parts._replace(query=urlencode(others)))
    if not parts.netloc:  # a socket: urlunsplit would leave out the slashes
        base = f"{parts.scheme}://{base.removeprefix(f'{parts.scheme}:').removeprefix('//')}"
    return Address(base, schema, f"{base}{'&' if others else '?'}schema={schema}")
