"""Decodes the messages of one topic, whatever definitions it was recorded with."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from fastswing_planner.cdr.batch import Messages
from fastswing_planner.cdr.column_decoder import ColumnDecoder
from fastswing_planner.cdr.columns import Columns, Times, field_paths
from fastswing_planner.cdr.schema import Schema
from fastswing_planner.cdr.stamps import to_ns
from fastswing_planner.errors import NoHeader, UndecodableMessage

TimeBase = Literal["log", "publish", "header"]
"""When a message was recorded, when it was published, or the stamp in its header."""


class TopicDecoder:
    """Makes columns of a topic's batches."""

    def __init__(
        self, topic: str, schema: Schema, time: TimeBase, fields: Sequence[str] | None
    ) -> None:
        self._topic = topic
        self._time = time
        self._stamp = _stamp_path(topic, schema) if time == "header" else ""
        wanted = fields
        if fields is not None and self._stamp:
            wanted = [*fields, f"{self._stamp}.sec", f"{self._stamp}.nanosec"]
        self._decoder = ColumnDecoder(schema, wanted)
        self._hidden = set(wanted or ()) - set(fields or ())

    def decode(self, batch: Sequence[Messages]) -> Columns:
        """Return a batch as columns; raises UndecodableMessage."""
        fields = named(self._topic, self._decoder.decode, batch)
        none = [Messages.none()]
        log_time = np.concatenate([part.log_time_ns for part in batch or none])
        publish_time = np.concatenate([part.publish_time_ns for part in batch or none])
        times = {"log": log_time, "publish": publish_time}
        time_ns = times[self._time] if self._time in times else self._header_time(fields)
        return Columns(
            self._topic,
            time_ns,
            log_time,
            publish_time,
            np.concatenate([part.sequence for part in batch or none]),
            {path: column for path, column in fields.items() if path not in self._hidden},
        )

    def _header_time(self, fields: Mapping[str, Any]) -> Times:
        seconds = fields[f"{self._stamp}.sec"].astype(np.int64)
        return np.asarray(to_ns(seconds, fields[f"{self._stamp}.nanosec"]))


def _stamp_path(topic: str, schema: Schema) -> str:
    """Return the path of the message's stamp."""
    paths = field_paths(schema)
    for stamp in ("header.stamp", "stamp"):
        parts = [paths.get(f"{stamp}.{part}") for part in ("sec", "nanosec")]
        if all(part is not None and part.ndim == 1 and part.dtype.kind in "iu" for part in parts):
            return stamp
    raise NoHeader(f"{topic} ({schema.name}) has no header: use the time base log or publish")


def named(topic: str, function: Any, *arguments: Any) -> Any:
    """Call `function`; an error about a message names its topic."""
    try:
        return function(*arguments)
    except UndecodableMessage as error:
        raise UndecodableMessage(f"{topic}: {error}") from error
