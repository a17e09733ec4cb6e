"""What commands have in common: arguments, and text for a terminal."""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from typing import NoReturn

_NEGATIVE = re.compile(r"^-[0-9.][0-9.,eE+-]*$")


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes -0.4,0,1 for numbers, not for an option."""

    def __init__(self, prog: str, description: str) -> None:
        """Name the program, and what it does."""
        super().__init__(prog, description=description)
        self._negative_number_matcher = _NEGATIVE  # argparse's own knows no commas

    def error(self, message: str) -> NoReturn:
        """Print the line and end with 2."""
        self.exit(2, f"{self.prog}: {message}; see --help\n")


def numbers(text: str) -> list[float]:
    """Return numbers with commas between; raises ArgumentTypeError."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"'{text}' is not numbers with commas") from error


def say(text: str) -> None:
    """Print a text, also to a reader that has seen enough, such as `head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Python would complain once more when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return aligned columns below a line; each row has as many cells as `head`."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
