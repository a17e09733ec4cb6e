"""One table for each node's parameters: it declares, validates and documents them."""

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from fastswing_planner.errors import InvalidParameter

_NEARLY = 0.8  # of difflib's similarity; parameters of different nodes are below


@dataclass(frozen=True)
class Parameter:
    """One row of a node's parameter table.

    default      also fixes the type: bool, int, float, str or list
    low, high    range of a number, or of each number of a list, both ends included
    choices      allowed texts
    unit         empty for texts, counts and switches
    read_only    True: takes effect only when the node is configured
    item         type of a list's elements: str or int
    """

    name: str
    default: Any
    description: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: Sequence[str] = ()
    read_only: bool = True
    item: type = str

    @property
    def range_text(self) -> str:
        """The valid values, for people."""
        if self.choices:
            return ", ".join(self.choices)
        if math.isinf(self.low) and math.isinf(self.high):
            return ""
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()

    def check(self, value: Any) -> Any:
        """Return `value`, or raise InvalidParameter naming the parameter and its valid values."""
        expected = type(self.default)
        if expected is list:
            return self._checked_list(value)
        if expected is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if not isinstance(value, expected) or (isinstance(value, bool) and expected is not bool):
            raise InvalidParameter(f"{self.name} is {value!r}, expected {expected.__name__}")
        # Also false for NaN.
        if expected in (int, float) and not self.low <= value <= self.high:
            valid = self.range_text or "a number"
            raise InvalidParameter(f"{self.name} is {value}, expected {valid}")
        if self.choices and value not in self.choices:
            raise InvalidParameter(f"{self.name} is '{value}', choose from: {self.range_text}")
        return value

    def _checked_list(self, value: Any) -> list[Any]:
        if value is None:  # what rclpy makes of an empty list in a file
            value = []
        if isinstance(value, array):  # and of a list of numbers
            value = value.tolist()
        if not isinstance(value, list) or not all(type(item) is self.item for item in value):
            wanted = "texts" if self.item is str else "whole numbers"
            raise InvalidParameter(f"{self.name} is {value!r}, expected a list of {wanted}")
        for item in value if self.item is int else ():
            if not self.low <= item <= self.high:
                raise InvalidParameter(f"{self.name} has {item}, expected {self.range_text}")
        return value


def check_all(table: Sequence[Parameter], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the checked values of a whole table; raises InvalidParameter for the first wrong."""
    return {row.name: row.check(values[row.name]) for row in table}


def check_change(row: Parameter, value: Any, judge: Callable[[str, Any], None] | None) -> None:
    """Raise InvalidParameter, or what `judge` raises, if a parameter may not become `value`.

    judge  gets name and checked value, and knows the robot; None while the node is not configured,
           when every valid value is accepted
    """
    checked = row.check(value)
    if judge is None:
        return
    judge(row.name, checked)
    if row.read_only:
        raise InvalidParameter(
            f"{row.name} takes effect at configuration: deactivate and clean up first"
        )


def unknown_name_text(name: str, known: Sequence[str]) -> str:
    """Return the warning that a parameter is ignored; raises InvalidParameter if it is misspelt.

    known  names of the node's parameters; `name` is none of them
    """
    if close := get_close_matches(name, known, 1, _NEARLY):
        raise InvalidParameter(f"unknown parameter '{name}', did you mean '{close[0]}'?")
    return f"unknown parameter '{name}' is ignored, choose from: {', '.join(known)}"
