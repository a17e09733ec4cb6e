"""Learned corrections of muscle lengths: what a robot's muscles differ from its MJCF by.

    l = h(theta) = h_MJCF(theta) + c(theta)
    c(theta) = mean + sum_k w_k exp(-|theta - theta_k|^2 / 2 s^2)

The paper learns h, because on a robot the geometric model is off. Here only the difference is
learned, so that what no data tell stays as the MJCF has it. The centres theta_k are spread over
the data, w is a ridge regression on all of them, and dc/dtheta corrects the muscle Jacobian.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np

from fastswing_planner.arrays import BoolMatrix, Matrix, Vector, frozen, frozen_flags
from fastswing_planner.errors import OutOfRange, RobotDescriptionError

REACH = 0.3
"""[rad] farther from every recorded posture the correction refuses to answer."""

_VERSION = 2


@dataclass(frozen=True)
class LengthCorrection:
    """The correction c.

    joint_names, muscle_names  order of the axes
    centers        theta_k [rad], shape (p, n)
    weights        w [m], shape (p, m)
    mean           [m] constant part, shape (m,)
    scale          s [rad]
    recorded       [rad] postures that stand for all samples, shape (k, n)
    taut           which muscles were taut there, shape (k, m)
    held_out_rms   [m] error on samples that were held out, shape (m,)
    slope          [m/rad] root mean square of |dc/dtheta| among the data, shape (m,)
    reach          [rad] farther from every posture with a taut muscle its length is refused
    """

    joint_names: tuple[str, ...]
    muscle_names: tuple[str, ...]
    centers: Matrix
    weights: Matrix
    mean: Vector
    scale: float
    recorded: Matrix
    taut: BoolMatrix
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

    def distance(self, joint_position: Vector) -> Vector:
        """Return how far the nearest posture is that each muscle was taut at [rad], shape (m,)."""
        away = np.linalg.norm(self.recorded - joint_position, axis=1)
        return frozen(np.where(self.taut, away[:, None], np.inf).min(axis=0))

    def uncertainty(self, joint_position: Vector) -> Vector:
        """Return the length's standard error [m], shape (m,): it grows away from the data.

        Beside the data it is the error on held-out samples; from there on the correction may
        change by as much per radian as it does among the data.
        """
        return frozen(np.hypot(self.held_out_rms, self.slope * self.distance(joint_position)))

    def check(self, joint_position: Vector) -> None:
        """Raise OutOfRange for a posture farther than `reach` from the data of some muscle."""
        distance = self.distance(joint_position)
        if not (distance <= self.reach).all():
            farthest = int(distance.argmax())
            angles = ", ".join(
                f"{name} {angle:.3f}"
                for name, angle in zip(self.joint_names, joint_position, strict=True)
            )
            raise OutOfRange(
                f"the learned muscle lengths do not reach {angles} rad: "
                f"{distance[farthest]:.2f} rad from every posture recorded with a taut "
                f"{self.muscle_names[farthest]}, at most {self.reach:g} rad; record there too"
            )

    def _kernel(self, joint_position: Vector) -> Vector:
        squares = ((joint_position - self.centers) ** 2).sum(axis=1)
        return np.asarray(np.exp(-0.5 * squares / self.scale**2))


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
                recorded=correction.recorded,
                taut=correction.taut,
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
            frozen(data["recorded"]),
            frozen_flags(data["taut"]),
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
