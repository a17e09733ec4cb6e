"""Writes topics of a bag as tables: `ros2 run fastswing_planner export_bag BAG... -o FOLDER`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fastswing_planner.bags import Bag, open_bag
from fastswing_planner.bags.table import FORMATS, write_table
from fastswing_planner.command_line import say
from fastswing_planner.errors import BagError, NoHeader, UndecodableMessage, one_line


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, or 2 after an error of one line."""
    options = _parser().parse_args(arguments)
    try:
        bag = open_bag(*options.bag)
        _export(bag, options)
    except BagError as error:
        print(f"export_bag: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="export_bag", description="Write the topics of a bag as tables, one file for each."
    )
    parser.add_argument("bag", nargs="+", help="MCAP file, or folder of them; several are one bag")
    parser.add_argument("-o", "--output", default=".", help="folder of the tables (default: here)")
    parser.add_argument("--topic", action="append", help="this topic; may be repeated (all)")
    parser.add_argument("--format", choices=FORMATS, default="csv", help="parquet needs pandas")
    parser.add_argument(
        "--time",
        choices=("log", "publish", "header"),
        default="log",
        help="time base of the column 'time': recorded, published, or the header's stamp",
    )
    return parser


def _export(bag: Bag, options: argparse.Namespace) -> None:
    folder = Path(options.output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BagError(f"cannot create {folder}: {error.strerror}") from error
    for name in options.topic or [n for n, topic in bag.topics.items() if topic.message_count]:
        path = folder / f"{one_line(name).strip('/').replace('/', '.')}.{options.format}"
        try:
            columns = bag.columns(name, time=options.time)
        except (UndecodableMessage, NoHeader) as error:
            if options.topic:
                raise
            print(f"left out: {error}", file=sys.stderr)
            continue
        write_table(columns, path, options.format)
        say(f"{path}: {columns.count} messages")
    for line in bag.warnings:
        print(f"warning: {line}", file=sys.stderr)


if __name__ == "__main__":
    raise SystemExit(main())
