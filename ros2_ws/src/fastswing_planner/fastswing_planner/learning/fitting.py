"""Fits what muscle lengths differ from the description, to recorded samples."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastswing_planner.arrays import BoolMatrix, BoolVector, Matrix, Vector, frozen, frozen_flags
from fastswing_planner.errors import InvalidRequest
from fastswing_planner.robot.length_correction import LengthCorrection

_SCALES = (0.5, 1.0, 2.0)  # [rad]
_RIDGES = (1e-6, 1e-4, 1e-2)
_JITTER = 1e-8
_FEWEST = 20
_FEWEST_TO_LEARN, _FEWEST_TO_CHECK = 15, 4
_RESOLUTION = 0.1  # [rad]


class TooFewSamples(InvalidRequest):
    """A bag with too little motion to learn from."""


def fit_correction(
    joint_names: Sequence[str],
    muscle_names: Sequence[str],
    joint_position: Matrix,
    difference: Matrix,
    usable: BoolMatrix | None = None,
    centers: int = 250,
) -> LengthCorrection:
    """Learn c from samples; scale and ridge are those with the least held-out error.

    joint_position  [rad] shape (k, n)
    difference      measured minus MJCF's length [m], shape (k, m)
    usable          samples of taut muscles, shape (k, m); None: all
    centers         at most as many

    Raises TooFewSamples.
    """
    if usable is None:
        usable = np.ones(difference.shape, dtype=bool)
    held_out = _held_out(len(joint_position))
    _check_counts(muscle_names, usable, held_out)
    chosen = spread_centers(joint_position, centers)
    best: tuple[float, float, float, Vector] | None = None
    for scale in _SCALES:
        basis, _ = _whitened(chosen, joint_position, scale)
        for ridge in _RIDGES:
            errors = _errors(basis, difference, usable, held_out, ridge)
            score = float(np.sqrt((errors**2).mean()))
            if best is None or score < best[0]:
                best = (score, scale, ridge, errors)
    assert best is not None
    _, scale, ridge, errors = best
    basis, back = _whitened(chosen, joint_position, scale)
    mean, hidden = _solve(basis, difference, usable, ridge)
    kept = covering_samples(joint_position, usable, _RESOLUTION)
    found = LengthCorrection(
        tuple(joint_names),
        tuple(muscle_names),
        frozen(chosen),
        frozen(back @ hidden),
        frozen(mean),
        scale,
        frozen(joint_position[kept]),
        frozen_flags(usable[kept]),
        frozen(errors),
        frozen(np.zeros(len(errors))),
    )
    slopes = np.array([found._slopes(center) for center in found.centers])
    return replace(found, slope=frozen(np.sqrt((slopes**2).sum(axis=2).mean(axis=0))))


def _check_counts(muscle_names: Sequence[str], usable: BoolMatrix, held_out: BoolVector) -> None:
    """Raise TooFewSamples unless each muscle has samples enough to learn from and to check with."""
    learn, check = usable[~held_out].sum(axis=0), usable[held_out].sum(axis=0)
    for name, learnt, checked in zip(muscle_names, learn, check, strict=True):
        if learnt + checked < _FEWEST:
            raise TooFewSamples(
                f"muscle {name} has {learnt + checked} usable samples, at least {_FEWEST} are "
                "needed: record more motion, with taut muscles"
            )
        if learnt < _FEWEST_TO_LEARN or checked < _FEWEST_TO_CHECK:
            raise TooFewSamples(
                f"muscle {name} was taut in too short a part of the recording: {learnt} usable "
                f"samples to learn from and {checked} to check with, at least {_FEWEST_TO_LEARN} "
                f"and {_FEWEST_TO_CHECK} are needed"
            )


def spread_centers(joint_position: Matrix, count: int) -> Matrix:
    """Return at most `count` samples far from each other, shape (p, n): farthest-point sampling."""
    first = int(np.argmin(np.linalg.norm(joint_position - joint_position.mean(axis=0), axis=1)))
    chosen = [first]
    distance = np.linalg.norm(joint_position - joint_position[first], axis=1)
    while len(chosen) < count and distance.max() > 1e-3:
        farthest = int(distance.argmax())
        chosen.append(farthest)
        away = np.linalg.norm(joint_position - joint_position[farthest], axis=1)
        distance = np.minimum(distance, away)
    return joint_position[chosen]


def covering_samples(joint_position: Matrix, usable: BoolMatrix, resolution: float) -> list[int]:
    """Return samples such that of each muscle every usable one is near to a usable one of them.

    Near: at most `resolution` [rad]. Shapes (k, n) and (k, m).
    """
    chosen: list[int] = []
    for muscle in np.unique(usable, axis=1).T:
        bare = np.flatnonzero(muscle)
        candidates = [index for index in chosen if muscle[index]]
        while bare.size:
            if candidates:
                index = candidates.pop()
            else:
                index = int(bare[0])
                chosen.append(index)
            away = np.linalg.norm(joint_position[bare] - joint_position[index], axis=1)
            bare = bare[away > resolution]
    return chosen


def _held_out(count: int) -> BoolVector:
    """Return every fifth stretch of the recording: neighbours in time are no independent test."""
    stretch = max(count // 50, 1)
    return np.asarray((np.arange(count) // stretch) % 5 == 2)


def _whitened(centers: Matrix, joint_position: Matrix, scale: float) -> tuple[Matrix, Matrix]:
    """Return the basis B = K_sample,centre L^-T with K_centre,centre = L L^T, and L^-T."""
    own = _kernels(centers, centers, scale)
    lower = np.linalg.cholesky(own + _JITTER * len(centers) * np.eye(len(centers)))
    back = np.linalg.inv(lower).T
    return _kernels(joint_position, centers, scale) @ back, back


def _kernels(left: Matrix, right: Matrix, scale: float) -> Matrix:
    squares = (left**2).sum(axis=1)[:, None] + (right**2).sum(axis=1) - 2.0 * left @ right.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / scale**2))


def _solve(
    basis: Matrix, difference: Matrix, usable: BoolMatrix, ridge: float
) -> tuple[Vector, Matrix]:
    """Return mean (m,) and v (p, m) that minimise |mean + B v - d|^2 + ridge k |v|^2 [m]."""
    means, solutions = [], []
    for column, rows in zip(difference.T, usable.T, strict=True):
        part, target = basis[rows], column[rows]
        mean = float(target.mean())
        normal = part.T @ part + ridge * len(part) * np.eye(part.shape[1])
        means.append(mean)
        solutions.append(np.linalg.solve(normal, part.T @ (target - mean)))
    return np.array(means), np.stack(solutions, axis=1)


def _errors(
    basis: Matrix, difference: Matrix, usable: BoolMatrix, held_out: BoolVector, ridge: float
) -> Vector:
    """Return the error on held-out samples [m], shape (m,); each muscle has some."""
    mean, hidden = _solve(basis, difference, usable & ~held_out[:, None], ridge)
    error = mean + basis @ hidden - difference
    tested = usable & held_out[:, None]
    squares = np.where(tested, error**2, 0.0).sum(axis=0)
    return np.asarray(np.sqrt(squares / tested.sum(axis=0)))
