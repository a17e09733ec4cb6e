"""Learned corrections of muscle lengths: what a robot's muscles differ from its MJCF by.

    l = h(theta) = h_MJCF(theta) + c(theta)
    c(theta) = mean + sum_k w_k exp(-|theta - theta_k|^2 / 2 s^2)

The paper learns h, because on a robot the geometric model is off. Here only the difference is
learned, so that what no data tell stays as the MJCF has it. The centres theta_k are spread over
the data, w is a ridge regression on all of them, and dc/dtheta corrects the muscle Jacobian.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fastswing_planner.arrays import BoolVector, Matrix, Vector, frozen
from fastswing_planner.errors import InvalidRequest, OutOfRange, RobotDescriptionError

BoolMatrix = npt.NDArray[np.bool_]

REACH = 0.3
"""[rad] farther from all recorded postures the correction refuses to answer."""

_SCALES = (0.5, 1.0, 2.0)  # [rad]
_RIDGES = (1e-6, 1e-4, 1e-2)
_JITTER = 1e-8
_FEWEST = 20
_VERSION = 1


class TooFewSamples(InvalidRequest):
    """A bag with too little motion to learn from."""


@dataclass(frozen=True)
class LengthCorrection:
    """The correction c.

    joint_names, muscle_names  order of the axes
    centers        theta_k [rad], shape (p, n)
    weights        w [m], shape (p, m)
    mean           [m] constant part, shape (m,)
    scale          s [rad]
    spread         [rad] every sample is this near to a centre
    held_out_rms   [m] error on samples that were held out, shape (m,)
    slope          [m/rad] root mean square of |dc/dtheta| among the data, shape (m,)
    reach          [rad] farther from all data it refuses
    """

    joint_names: tuple[str, ...]
    muscle_names: tuple[str, ...]
    centers: Matrix
    weights: Matrix
    mean: Vector
    scale: float
    spread: float
    held_out_rms: Vector
    slope: Vector
    reach: float = REACH

    def lengths(self, joint_position: Vector) -> Vector:
        """Return c(theta) [m], shape (m,); raises OutOfRange far from all data."""
        self.check(joint_position)
        return frozen(self.mean + self._kernel(joint_position) @ self.weights)

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return dc/dtheta [m/rad], shape (m, n); raises OutOfRange far from all data."""
        self.check(joint_position)
        return frozen(self._slopes(joint_position))

    def _slopes(self, joint_position: Vector) -> Matrix:
        away = (joint_position - self.centers) / self.scale**2
        # d exp(-|x|^2 / 2 s^2) / dx = -x / s^2 exp(...)
        return -self.weights.T @ (away * self._kernel(joint_position)[:, None])

    def distance(self, joint_position: Vector) -> float:
        """Return the distance to the recorded postures [rad]; 0 among them."""
        nearest = float(np.linalg.norm(self.centers - joint_position, axis=1).min())
        return max(nearest - self.spread, 0.0)

    def uncertainty(self, joint_position: Vector) -> Vector:
        """Return the length's standard error [m], shape (m,): it grows away from the data.

        Beside the data it is the error on held-out samples; from there on the correction may
        change by as much per radian as it does among the data.
        """
        return frozen(np.hypot(self.held_out_rms, self.slope * self.distance(joint_position)))

    def check(self, joint_position: Vector) -> None:
        """Raise OutOfRange for a posture farther than `reach` from all data."""
        distance = self.distance(joint_position)
        if not distance <= self.reach:
            angles = ", ".join(
                f"{name} {angle:.3f}"
                for name, angle in zip(self.joint_names, joint_position, strict=True)
            )
            raise OutOfRange(
                f"the learned muscle lengths do not reach {angles} rad: {distance:.2f} rad from "
                f"all recorded postures, at most {self.reach:g} rad; record there too"
            )

    def _kernel(self, joint_position: Vector) -> Vector:
        squares = ((joint_position - self.centers) ** 2).sum(axis=1)
        return np.asarray(np.exp(-0.5 * squares / self.scale**2))


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
    for name, count in zip(muscle_names, usable.sum(axis=0), strict=True):
        if count < _FEWEST:
            raise TooFewSamples(
                f"muscle {name} has {count} usable samples, at least {_FEWEST} are needed: record "
                "more motion, with taut muscles"
            )
    chosen, spread = spread_centers(joint_position, centers)
    held_out = _held_out(len(joint_position))
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
    found = LengthCorrection(
        tuple(joint_names),
        tuple(muscle_names),
        frozen(chosen),
        frozen(back @ hidden),
        frozen(mean),
        scale,
        spread,
        frozen(errors),
        frozen(np.zeros(len(errors))),
    )
    slopes = np.array([found.jacobian(center) for center in found.centers])
    return replace(found, slope=frozen(np.sqrt((slopes**2).sum(axis=2).mean(axis=0))))


def spread_centers(joint_position: Matrix, count: int) -> tuple[Matrix, float]:
    """Return at most `count` samples far from each other, and how near every sample is to one.

    Farthest-point sampling: shapes (p, n), and [rad].
    """
    first = int(np.argmin(np.linalg.norm(joint_position - joint_position.mean(axis=0), axis=1)))
    chosen = [first]
    distance = np.linalg.norm(joint_position - joint_position[first], axis=1)
    while len(chosen) < count and distance.max() > 1e-3:
        farthest = int(distance.argmax())
        chosen.append(farthest)
        away = np.linalg.norm(joint_position - joint_position[farthest], axis=1)
        distance = np.minimum(distance, away)
    return joint_position[chosen], float(distance.max())


def save_correction(correction: LengthCorrection, path: Path, mjcf_hash: str) -> None:
    """Write a correction; raises RobotDescriptionError."""
    try:
        with open(path, "wb") as stream:
            np.savez_compressed(
                stream,
                version=_VERSION,
                mjcf_hash=mjcf_hash,
                joint_names=np.array(correction.joint_names),
                muscle_names=np.array(correction.muscle_names),
                centers=correction.centers,
                weights=correction.weights,
                mean=correction.mean,
                scale=correction.scale,
                spread=correction.spread,
                held_out_rms=correction.held_out_rms,
                slope=correction.slope,
                reach=correction.reach,
            )
    except OSError as error:
        raise RobotDescriptionError(f"cannot write {path}: {error.strerror or error}") from error


def load_correction(
    path: Path, joint_names: Sequence[str], muscle_names: Sequence[str], mjcf_hash: str
) -> LengthCorrection:
    """Read a correction of this arm; raises RobotDescriptionError if it is of another one."""
    try:
        with np.load(BytesIO(path.read_bytes()), allow_pickle=False) as content:
            data = {key: content[key] for key in content.files}
        made_for = str(data["mjcf_hash"])
        correction = LengthCorrection(
            tuple(map(str, data["joint_names"])),
            tuple(map(str, data["muscle_names"])),
            frozen(data["centers"]),
            frozen(data["weights"]),
            frozen(data["mean"]),
            float(data["scale"]),
            float(data["spread"]),
            frozen(data["held_out_rms"]),
            frozen(data["slope"]),
            float(data["reach"]),
        )
    except Exception as error:  # numpy raises whatever a damaged file leads to
        raise RobotDescriptionError(
            f"{path} holds no learned muscle lengths ({type(error).__name__}); write it with "
            "learn_model"
        ) from error
    for what, found, wanted in (
        ("joints", correction.joint_names, tuple(joint_names)),
        ("muscles", correction.muscle_names, tuple(muscle_names)),
    ):
        if found != wanted:
            raise RobotDescriptionError(
                f"{path} is learned for the {what} {', '.join(found)}, the robot has "
                f"{', '.join(wanted)}"
            )
    if made_for != mjcf_hash:
        raise RobotDescriptionError(
            f"{path} is learned on another MJCF than the robot's: learn it again"
        )
    return correction


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
    """Return the error on held-out samples [m], shape (m,); NaN counts as the whole difference."""
    mean, hidden = _solve(basis, difference, usable & ~held_out[:, None], ridge)
    error = mean + basis @ hidden - difference
    tested = usable & held_out[:, None]
    squares = np.where(tested, error**2, 0.0).sum(axis=0)
    return np.asarray(np.sqrt(squares / np.maximum(tested.sum(axis=0), 1)))
