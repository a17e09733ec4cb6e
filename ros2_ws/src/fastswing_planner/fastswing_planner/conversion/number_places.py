"""Where the numbers and texts of a serialised message stand.

In a serialised message the place of everything follows from the lengths before it (`cdr/layout`).
So messages whose texts and lengths agree have their numbers at the same places, and a node that
sends or gets a message a thousand times a second needs the middleware's conversion for the first
one only.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fastswing_planner.cdr.layout import Layout, Leaf
from fastswing_planner.cdr.primitives import PRIMITIVES, is_message
from fastswing_planner.cdr.schema import Repeat, Schema, parse_ros2msg
from fastswing_planner.conversion.definitions import definition_text

STAMP = ("header.stamp.sec", "header.stamp.nanosec")
"""The numbers of a message's header."""


def schema_of(message_type: type) -> Schema:
    """Return what an installed type consists of; raises TypeError for a sequence of messages."""
    package = message_type.__module__.partition(".")[0]
    return _installed_schema(f"{package}/msg/{message_type.__name__}")


@lru_cache
def _installed_schema(name: str) -> Schema:
    schema = parse_ros2msg(name, definition_text(name))
    for fields in schema.types.values():
        for field in fields:
            if field.repeat is not Repeat.ONCE and is_message(field.type_name):
                raise TypeError(f"{name} has a sequence of messages, {field.name}: no fixed places")
    return schema


class Number(NamedTuple):
    """Where a number stands, or several one behind the other.

    dtype, code  its type in numpy and in struct
    length       None for one that stands alone
    """

    field: str
    dtype: np.dtype[Any]
    code: str
    length: int | None
    offset: int


def numbers_at(layout: Layout, fields: Sequence[str]) -> list[Number]:
    """Return where the fields stand, in their order; raises KeyError for one that is no number."""
    leaves = {leaf.path: leaf for leaf in layout.leaves if leaf.type_name in PRIMITIVES}
    order = "<" if layout.little_endian else ">"
    found = []
    for field in fields:
        leaf = leaves[field]
        primitive = PRIMITIVES[leaf.type_name]
        count = leaf.sizes[0] if leaf.repeated else None
        dtype = np.dtype(order + primitive.dtype)
        found.append(Number(field, dtype, order + primitive.code, count, leaf.offsets[0]))
    return found


def text_places(layout: Layout) -> set[int]:
    """Return the places of all lengths and texts, and of the byte order."""
    texts = (leaf for leaf in layout.leaves if leaf.type_name not in PRIMITIVES)
    return set(layout.structure).union(*(places_of(leaf, 1) for leaf in texts))


def number_places(layout: Layout) -> set[int]:
    """Return the places of all numbers."""
    numbers = (leaf for leaf in layout.leaves if leaf.type_name in PRIMITIVES)
    return set().union(*(places_of(leaf, PRIMITIVES[leaf.type_name].size) for leaf in numbers))


def places_of(leaf: Leaf, item_size: int) -> set[int]:
    """Return the places of a leaf whose items have `item_size` bytes."""
    return {
        place
        for begin, size in zip(leaf.offsets, leaf.sizes, strict=True)
        for place in range(begin, begin + size * item_size)
    }


def marked(size: int, places: set[int]) -> npt.NDArray[np.bool_]:
    """Return which of `size` bytes stand at `places`, shape (size,)."""
    mask = np.zeros(size, dtype=np.bool_)
    mask[list(places)] = True
    return mask
