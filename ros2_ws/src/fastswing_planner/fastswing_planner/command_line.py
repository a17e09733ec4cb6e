"""What the command lines of `plan` and `swing` have in common."""

import argparse
import os
import re
import sys
from typing import NoReturn

from fastswing_planner.planning.request import Method

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

    def add_swing(self, robot: str, method: Method) -> None:
        """Add what says which swing; arguments are the defaults."""
        methods = [one.name.lower() for one in Method]
        default = method.name.lower()
        self.add_argument(
            "--robot", default=robot, help="YAML file of the robot; default: %(default)s"
        )
        self.add_argument(
            "--start", default="start", help="angles [rad] with commas, or a posture of the robot"
        )
        self.add_argument("--end", default="end", help="the same")
        self.add_argument("--method", choices=methods, default=default, help="default: %(default)s")


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
