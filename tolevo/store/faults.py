"""What is wrong with the address of a shared store, before anything is written."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import Fault
from .address import read_address

if TYPE_CHECKING:
    from .backend import Backend, Foreign, Newer


def store_faults(address: str, place: str, look: bool = True) -> list[Fault]:
    """An address that is not valid or has a password, a driver that is missing and, where the store is
    looked at, a server that does not answer, or tables of another program or a newer version.
    """
    try:
        known = read_address(address)
    except ValueError as error:
        return [Fault(place, str(error))]
    if not look:
        return []
    try:
        from .backend import DAMAGE, Foreign, Newer
        from .postgresql import PostgreSQL
        from .store import Store
    except ImportError as error:
        return [Fault(place, f"needs a driver ({error}): pip install 'tolevo[postgres]'")]
    backend = PostgreSQL(known)
    try:
        Store(backend, reading=True).close()
    except (Newer, Foreign) as error:
        return [Fault(place, f"{backend.display_name} {not_ours(error, backend)}")]
    except DAMAGE as error:
        why, remedy = backend.explained(error)
        return [Fault(place, f"{backend.display_name}: {why}; {remedy}")]
    return []


def not_ours(error: Newer | Foreign, backend: Backend) -> str:
    """Why tables cannot be used, and the remedy."""
    if not error.args:
        return f"is not the database of a study; {backend.alternative}"
    from .tables import FORMAT

    return (
        f"was written by a newer version of tolevo (format {error.args[0]}, this one reads up "
        f"to {FORMAT}): update tolevo, or {backend.alternative}"
    )
