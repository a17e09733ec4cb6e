"""Columns of a bag as a flat table: for pandas, as CSV, as Parquet."""

import csv
import json
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from fastswing_planner.cdr.columns import Column, Columns
from fastswing_planner.cdr.stamps import from_ns
from fastswing_planner.errors import BagError, UndecodableMessage

FORMATS = ("csv", "parquet")


class MissingLibrary(BagError):
    """A library that only this needs is not installed."""


def flat_columns(columns: Columns) -> dict[str, Column]:
    """Return arrays of one dimension: 'time', then each field, a column of its own per element.

    Elements are called by the message's names where it has one for each, position[E-p], else by
    their number, position[0]. Sequences whose length changes stay one column of lists.
    """
    flat: dict[str, Column] = {"time": columns.time}
    names = _names(columns)
    for path, column in columns.fields.items():
        if column.ndim == 1:
            flat[path] = column
            continue
        labels = names if len(names) == column.shape[1] else range(column.shape[1])
        for index, label in enumerate(labels):
            flat[f"{path}[{label}]"] = column[:, index]
    return flat


def _names(columns: Columns) -> tuple[str, ...]:
    try:
        names = columns.names("name") if "name" in columns else ()
    except UndecodableMessage:
        return ()
    return names if len(set(names)) == len(names) else ()


def data_frame(columns: Columns) -> Any:
    """Return a pandas.DataFrame of `flat_columns`; raises MissingLibrary without pandas."""
    try:
        pandas = import_module("pandas")
    except ImportError as error:
        raise MissingLibrary(
            "pandas is not installed: pip install pandas, or use the columns as they are"
        ) from error
    return pandas.DataFrame(flat_columns(columns))


def write_table(columns: Columns, path: Path, table_format: str) -> None:
    """Write the columns as 'csv' or 'parquet'; raises BagError."""
    if table_format not in FORMATS:
        raise BagError(f"no format '{table_format}'; choose from: {', '.join(FORMATS)}")
    try:
        if table_format == "csv":
            _write_csv(columns, path)
        else:
            _write_parquet(columns, path)
    except OSError as error:
        if isinstance(error, BagError):
            raise
        raise BagError(f"cannot write {path}: {error.strerror or error}") from error


def _write_csv(columns: Columns, path: Path) -> None:
    """Write numbers so that reading them gives the very same; times with all nanoseconds."""
    flat = flat_columns(columns)
    flat["time"] = np.array([_seconds(time) for time in columns.time_ns.tolist()], dtype=object)
    with open(path, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(flat)
        writer.writerows(zip(*map(_cells, flat.values()), strict=True))


def _seconds(time_ns: int) -> str:
    sign, (sec, nanosec) = "-" if time_ns < 0 else "", from_ns(abs(time_ns))
    return f"{sign}{sec}.{nanosec:09d}"


def _cells(column: Column) -> Iterator[Any]:
    if column.dtype == bool:
        return iter(column.astype(int).tolist())
    if column.dtype == object:
        return (value if isinstance(value, str) else json.dumps(value.tolist()) for value in column)
    return iter(column.tolist())


def _write_parquet(columns: Columns, path: Path) -> None:
    frame = data_frame(columns)
    try:
        frame.to_parquet(path)
    except ImportError as error:
        raise MissingLibrary(
            "Parquet needs pyarrow: pip install pyarrow, or use the format csv"
        ) from error
