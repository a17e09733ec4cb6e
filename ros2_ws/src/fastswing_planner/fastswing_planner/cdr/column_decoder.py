"""Serialised messages of one type to numpy columns, many messages at a time.

Messages of one layout (see `cdr/layout`) are rows of one byte matrix, and a field is some of its
columns. Every message is compared with its layout; where none fits, the message is walked.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fastswing_planner.cdr.batch import Messages
from fastswing_planner.cdr.columns import Column, assembled, field_paths
from fastswing_planner.cdr.layout import Layout, Leaf, layout_of, text_of
from fastswing_planner.cdr.primitives import PRIMITIVES
from fastswing_planner.cdr.schema import Schema
from fastswing_planner.errors import UnknownTopic

Bytes = npt.NDArray[np.uint8]

_KEPT_LAYOUTS = 64


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
        return {path: assembled(parts[path], count, self.paths[path]) for path in parts}

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
