"""One table of primitive types: struct and numpy agree on each."""

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.cdr.primitives import PRIMITIVES, is_message


@pytest.mark.parametrize("name", PRIMITIVES)
def test_numpy_has_the_names_of_ros(name: str) -> None:
    assert np.dtype(PRIMITIVES[name].dtype) == np.dtype(name)


@given(st.sampled_from(list(PRIMITIVES)), st.sampled_from("<>"), st.data())
def test_struct_and_numpy_read_the_same_number(name: str, order: str, data: st.DataObject) -> None:
    kind = PRIMITIVES[name]
    raw = data.draw(st.binary(min_size=kind.size, max_size=kind.size))
    if name == "bool":
        raw = bytes([raw[0] & 1])
    (expected,) = struct.unpack(order + kind.code, raw)
    found: Any = np.frombuffer(raw, order + kind.dtype)[0]
    assert found == expected or (np.isnan(found) and np.isnan(expected))


def test_a_primitive_and_a_text_are_no_messages() -> None:
    assert not any(map(is_message, [*PRIMITIVES, "string", "wstring"]))
    assert is_message("std_msgs/msg/Header")
