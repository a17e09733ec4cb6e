"""Arrays with checked content: shapes, finiteness, names."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike, NDArray

from fastswing_planner.errors import DuplicateName, NotFinite, UnknownName, WrongLength

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
BoolVector = NDArray[np.bool_]


def frozen(values: ArrayLike) -> Vector:
    """Return a read-only float copy of `values`."""
    return read_only(np.array(values, dtype=np.float64))


def read_only(array: Vector) -> Vector:
    """Return `array` itself, made read-only; for one that was just made and nobody else holds."""
    array.setflags(write=False)
    return array


def constant(value: float) -> Vector:
    """Return a number as a read-only array of shape (): numpy takes it faster than a plain one."""
    return read_only(np.array(value, dtype=np.float64))


def contiguous(indices: ArrayLike) -> NDArray[np.int_] | slice:
    """Return indices that follow each other as a slice, which copies nothing; others unchanged."""
    numbers = np.asarray(indices, dtype=int)
    first = int(numbers[0]) if numbers.size else 0
    if np.array_equal(numbers, np.arange(first, first + numbers.size)):
        return slice(first, first + numbers.size)
    return numbers


def frozen_flags(values: ArrayLike) -> NDArray[np.bool_]:
    """Return a read-only copy of `values` as booleans."""
    array = np.array(values, dtype=np.bool_)
    array.setflags(write=False)
    return array


def finite_vector(what: str, values: ArrayLike, names: Sequence[str]) -> Vector:
    """Return `values` as a read-only vector with one finite number for each of `names`.

    Raises WrongLength or NotFinite; the text calls the array `what` and names the element.
    """
    array = frozen(values)
    if array.shape != (len(names),):
        raise WrongLength(
            f"{what} has {array.size} values, expected {len(names)}: {', '.join(names)}"
        )
    if np.isfinite(array).all():
        return array
    for name, value in zip(names, array, strict=True):
        if not np.isfinite(value):
            raise NotFinite(f"{what} of {name} is {value}, expected a finite number")
    return array


def unique_known(what: str, names: Sequence[str], valid: Sequence[str]) -> list[int]:
    """Return the index in `valid` of each of `names`.

    Raises UnknownName or DuplicateName; the text calls an element `what`.
    """
    for name in names:
        if name not in valid:
            raise UnknownName(f"unknown {what} '{name}', choose from: {', '.join(valid)}")
        if list(names).count(name) > 1:
            raise DuplicateName(f"{what} '{name}' is named more than once")
    return [list(valid).index(name) for name in names]


def named_vector(
    what: str, kind: str, names: Sequence[str], values: ArrayLike, valid: Sequence[str]
) -> Vector:
    """Return `values`, given in the order of `names`, in the order of `valid`.

    Empty `names` mean the order of `valid`. All of `valid` must be named.
    Raises WrongLength, NotFinite, UnknownName or DuplicateName.
    """
    if not names:
        return finite_vector(what, values, valid)
    index = unique_known(kind, names, valid)
    if len(index) != len(valid):
        missing = [name for name in valid if name not in names]
        raise WrongLength(f"{what} lacks {kind} {', '.join(missing)}")
    ordered = np.empty(len(valid))
    ordered[index] = finite_vector(what, values, names)
    return frozen(ordered)


BoolMatrix = npt.NDArray[np.bool_]
