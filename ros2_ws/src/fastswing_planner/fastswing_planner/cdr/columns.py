"""Messages as one numpy array per field."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fastswing_planner.cdr.primitives import PRIMITIVES, is_message
from fastswing_planner.cdr.schema import Repeat, Schema
from fastswing_planner.errors import UndecodableMessage, UnknownTopic

Column = npt.NDArray[Any]
Times = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Columns(Mapping[str, Column]):
    """Messages of one topic, one array per field.

    topic            name
    time_ns          [ns] since 1970 on the time base asked for, shape (k,)
    log_time_ns      [ns] when each was recorded, shape (k,)
    publish_time_ns  [ns] when each was published, shape (k,)
    sequence         the publisher's count, shape (k,)
    fields           path ('header.stamp.sec') -> array

    A number is an array (k,) of the field's own type, an array or sequence (k, n). Sequences whose
    length changes are object arrays (k,) of arrays. Texts are object arrays of str. Inside of
    sequences of messages there are no columns; `Bag.messages` shows them.
    """

    topic: str
    time_ns: Times
    log_time_ns: Times
    publish_time_ns: Times
    sequence: npt.NDArray[np.uint32]
    fields: Mapping[str, Column]

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """[s] since 1970, shape (k,); exact to 0.3 us, differences of `time_ns` to 1 ns."""
        return np.asarray(self.time_ns * 1e-9)

    @property
    def count(self) -> int:
        """Number of messages; `len` is that of fields."""
        return int(self.time_ns.size)

    def __getitem__(self, path: str) -> Column:
        try:
            return self.fields[path]
        except KeyError:
            raise UnknownTopic(
                f"{self.topic} has no field '{path}'; choose from: {', '.join(self.fields)}"
            ) from None

    def __contains__(self, path: object) -> bool:
        return path in self.fields

    def __iter__(self) -> Iterator[str]:
        return iter(self.fields)

    def __len__(self) -> int:
        return len(self.fields)

    def names(self, path: str = "name") -> tuple[str, ...]:
        """Return a sequence of texts that is the same in all messages; raises UndecodableMessage.

        Empty if there are no messages.
        """
        column = self[path]
        if not self.count:
            return ()
        if column.ndim == 2 and (column.strides[0] == 0 or bool((column == column[0]).all())):
            return tuple(column[0])
        raise UndecodableMessage(f"{path} of {self.topic} changes from message to message")


def field_paths(schema: Schema) -> dict[str, Column]:
    """Return each field that has a column: path -> the column of no messages."""
    found: dict[str, Column] = {}

    def visit(type_name: str, prefix: str) -> None:
        for field in schema.types[type_name]:
            path = prefix + field.name
            if not is_message(field.type_name):
                shape = (0,) if field.repeat is Repeat.ONCE else (0, field.count)
                found[path] = np.empty(shape, _dtype(field.type_name))
            elif field.repeat is Repeat.ONCE:
                visit(field.type_name, f"{path}.")

    visit(schema.name, "")
    return found


def _dtype(type_name: str) -> str:
    return PRIMITIVES[type_name].dtype if type_name in PRIMITIVES else "O"


def joined(columns: Sequence[Column]) -> Column:
    """Return one column of several that follow each other."""
    if len(columns) == 1:
        return columns[0]
    first = columns[0]
    if all(column.shape[1:] == first.shape[1:] for column in columns):
        if first.dtype == object and all(_repeats(column, first) for column in columns):
            total = sum(len(column) for column in columns)
            return np.broadcast_to(first[:1], (total, *first.shape[1:]))
        if not any(column.dtype == object for column in columns) or first.dtype == object:
            return np.concatenate(columns)
    whole = np.empty(sum(len(column) for column in columns), dtype=object)
    at = 0
    for column in columns:
        for row in column:
            whole[at] = row
            at += 1
    return whole


def assembled(
    parts: Sequence[tuple[npt.NDArray[np.intp], Column]], count: int, empty: Column
) -> Column:
    """Return the column whose rows stand in parts at their places."""
    if not parts:
        return empty
    first = parts[0][1]
    if len(parts) == 1:
        return first
    if all(column.shape[1:] == first.shape[1:] for _, column in parts):
        if first.dtype == object and all(_repeats(column, first) for _, column in parts):
            return np.broadcast_to(first[:1], (count, *first.shape[1:]))
        whole = np.empty((count, *first.shape[1:]), dtype=first.dtype)
        for places, column in parts:
            whole[places] = column
        return whole
    ragged = np.empty(count, dtype=object)
    for places, column in parts:
        for place, row in zip(places, column, strict=True):
            ragged[place] = row
    return ragged


def _repeats(column: Column, first: Column) -> bool:
    """Whether a column of objects repeats the first row of another without storing it again."""
    return (
        column.dtype == object
        and (len(column) == 1 or (len(column) > 0 and column.strides[0] == 0))
        and bool(np.all(column[0] == first[0]))
    )
