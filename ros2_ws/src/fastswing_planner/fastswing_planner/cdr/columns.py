"""Serialised messages of one type to numpy columns, many messages at a time.

Messages of one layout (see `cdr_layout`) are rows of one byte matrix, and a field is some of its
columns. Every message is compared with its layout; where none fits, the message is walked.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fastswing_planner.cdr.batch import Messages
from fastswing_planner.cdr.layout import Layout, Leaf, layout_of, text_of
from fastswing_planner.cdr.primitives import PRIMITIVES, is_message
from fastswing_planner.cdr.schema import Repeat, Schema
from fastswing_planner.errors import UndecodableMessage, UnknownTopic

Column = npt.NDArray[Any]
Bytes = npt.NDArray[np.uint8]
Times = npt.NDArray[np.int64]

_KEPT_LAYOUTS = 64


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


class ColumnDecoder:
    """Decodes messages of one type; keeps the layouts it has seen."""

    def __init__(self, schema: Schema, fields: Sequence[str] | None = None) -> None:
        """Decode `fields`, or all; raises UnknownTopic for one that the type does not have."""
        self.schema = schema
        self.paths = field_paths(schema)
        for path in fields or ():
            if path not in self.paths:
                raise UnknownTopic(
                    f"{schema.name} has no field '{path}'; choose from: {', '.join(self.paths)}"
                )
        if fields is not None:
            self.paths = {path: self.paths[path] for path in fields}
        self._layouts: dict[int, list[Layout]] = {}

    def decode(self, messages: Sequence[Messages]) -> dict[str, Column]:
        """Return a column for each field; raises UndecodableMessage."""
        parts: dict[str, list[tuple[npt.NDArray[np.intp], Column]]] = {
            path: [] for path in self.paths
        }
        for places, rows in _by_size(messages):
            for chosen, layout in self._matches(rows):
                matrix = rows if chosen.size == len(rows) else rows[chosen]
                for leaf in layout.leaves:
                    if leaf.path in parts:
                        column = _column(matrix, layout, leaf)
                        parts[leaf.path].append((places[chosen], column))
        count = sum(map(len, messages))
        return {path: _assembled(parts[path], count, self.paths[path]) for path in parts}

    def _matches(self, rows: Bytes) -> Iterator[tuple[npt.NDArray[np.intp], Layout]]:
        """Yield each layout with the rows that follow it; together they are all rows."""
        left = np.arange(len(rows))
        known = self._layouts.setdefault(rows.shape[1], [])
        for layout in tuple(known):
            if not left.size:
                return
            fits = _fits(rows, left, layout)
            if fits.any():
                yield left[fits], layout
                left = left[~fits]
        while left.size:
            layout = layout_of(self.schema, rows[left[0]].tobytes())
            fits = _fits(rows, left, layout)
            yield left[fits], layout
            left = left[~fits]
            known.append(layout)
            del known[:-_KEPT_LAYOUTS]


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


def _repeats(column: Column, first: Column) -> bool:
    """Whether a column of objects repeats the first row of another without storing it again."""
    return (
        column.dtype == object
        and (len(column) == 1 or (len(column) > 0 and column.strides[0] == 0))
        and bool(np.all(column[0] == first[0]))
    )


def _by_size(messages: Sequence[Messages]) -> Iterator[tuple[npt.NDArray[np.intp], Bytes]]:
    """Yield messages of equal size as rows, with their places among all."""
    if not messages:
        return
    sizes = np.concatenate([part.size for part in messages])
    for size in np.unique(sizes).tolist():
        yield np.flatnonzero(sizes == size), np.concatenate([p.rows(size) for p in messages])


def _fits(rows: Bytes, left: npt.NDArray[np.intp], layout: Layout) -> npt.NDArray[np.bool_]:
    """Return which of the rows `left` follow a layout."""
    template = np.frombuffer(layout.template, dtype=np.uint8)
    matrix = rows if left.size == len(rows) else rows[left]
    return np.asarray((matrix[:, layout.structure] == template).all(axis=1))


def _column(matrix: Bytes, layout: Layout, leaf: Leaf) -> Column:
    """Return the field's values in all rows: (k,) or, if repeated, (k, n)."""
    if leaf.type_name == "string":
        column = _text_column(matrix, leaf)
    else:
        order = "<" if layout.little_endian else ">"
        dtype = np.dtype(order + PRIMITIVES[leaf.type_name].dtype)
        begin, count = leaf.offsets[0], leaf.sizes[0]
        raw = np.ascontiguousarray(matrix[:, begin : begin + count * dtype.itemsize])
        if leaf.type_name == "bool":
            raw = np.minimum(raw, 1)
        if not count:
            column = np.empty((len(matrix), 0), dtype.newbyteorder("="))
        else:
            column = raw.view(dtype).astype(dtype.newbyteorder("="), copy=False)
    return column if leaf.repeated else column[:, 0]


def _text_column(matrix: Bytes, leaf: Leaf) -> Column:
    texts = [_texts(matrix[:, at : at + n]) for at, n in zip(leaf.offsets, leaf.sizes, strict=True)]
    if all(text.strides[0] == 0 for text in texts):
        row = np.array([text[0] for text in texts], dtype=object)
        return np.broadcast_to(row, (len(matrix), len(texts)))
    return np.stack(texts, axis=1)


def _texts(region: Bytes) -> Column:
    """Return the texts of equal size that the rows are; one text with stride 0 if all are equal."""
    count, size = region.shape
    if not size or (region == region[0]).all():
        same = np.array([text_of(region[0].tobytes())], dtype=object)
        # Not through broadcast_to alone: of one row it would keep the stride.
        return np.lib.stride_tricks.as_strided(same, (count,), (0,), writeable=False)
    distinct, inverse = np.unique(region, axis=0, return_inverse=True)
    found = np.array([text_of(row.tobytes()) for row in distinct], dtype=object)
    return found[inverse.reshape(-1)]


def _assembled(
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
