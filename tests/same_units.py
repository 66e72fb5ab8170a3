"""Loaded units whose meshes and tables are computed once, however often they are built."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tolevo.models.rv_reducer.dynamics import NEGLIGIBLE_AMPLITUDE, OrderTable
from tolevo.models.rv_reducer.lost_motion import LoadedUnit

_meshes: dict[bytes, Any] = {}
_tables: dict[tuple[int, float, float], OrderTable] = {}


@contextmanager
def made_once() -> Iterator[None]:
    """A unit of the same contact and errors has the mesh, and the table of it, of the first."""
    mesh, table = LoadedUnit.mesh, OrderTable.of

    def kept_mesh(unit: LoadedUnit, samples: int) -> Any:
        key = pickle.dumps((unit, samples))
        if key not in _meshes:
            _meshes[key] = mesh(unit, samples)
        return _meshes[key]

    def kept_table(found: Any, most: float, left_out: float = NEGLIGIBLE_AMPLITUDE) -> OrderTable:
        if not any(found is one for one in _meshes.values()):
            return table(found, most, left_out)
        key = (id(found), most, left_out)
        if key not in _tables:
            _tables[key] = table(found, most, left_out)
        return _tables[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LoadedUnit, "mesh", kept_mesh)
        patch.setattr(OrderTable, "of", staticmethod(kept_table))
        yield
