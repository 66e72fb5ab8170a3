"""Content with its own digest: whatever is not as it was written is refused."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tolevo.files import loads, seal_content, seal_record, unseal_content, unseal_record


def test_the_digest_is_sha256_of_what_stands_before_it() -> None:
    assert seal_content(b"abc") == (
        b"abc\nsha256 ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad\n"
    )  # NIST FIPS 180-2, appendix B.1


@given(content=st.binary(max_size=200), place=st.integers(0), flip=st.integers(1, 255))
def test_every_byte_counts(content: bytes, place: int, flip: int) -> None:
    whole = bytearray(seal_content(content))
    assert unseal_content(bytes(whole)) == content
    whole[place % len(whole)] ^= flip
    with pytest.raises(ValueError, match="digest"):
        unseal_content(bytes(whole))


@given(content=st.binary(max_size=200), cut=st.integers(1))
def test_a_cut_file_is_refused(content: bytes, cut: int) -> None:
    whole = seal_content(content)
    with pytest.raises(ValueError, match="digest"):
        unseal_content(whole[: len(whole) - 1 - cut % len(whole)])


def test_a_record_belongs_to_what_it_was_sealed_for() -> None:
    record = seal_record({"number": 3, "values": [0.1, 2.5e-300]}, of="one analysis")
    again = json.loads(json.dumps(record))
    assert unseal_record(again, of="one analysis") == {"number": 3, "values": [0.1, 2.5e-300]}
    text = 'one analysis\n{"number": 3, "values": [0.1, 2.5e-300]}'
    assert record["sha256"] == hashlib.sha256(text.encode()).hexdigest()
    others: tuple[Any, ...] = ({**again, "number": 4}, {**again, "more": 1}, {"number": 3}, [], None)
    for other in others:
        with pytest.raises(ValueError, match="digest"):
            unseal_record(other, of="one analysis")
    with pytest.raises(ValueError, match="does not fit its digest"):
        unseal_record(again, of="another")


def test_what_is_nested_too_deep_is_no_crash() -> None:
    with pytest.raises(ValueError, match="nested too deep"):
        loads("[" * 1_000_000)
