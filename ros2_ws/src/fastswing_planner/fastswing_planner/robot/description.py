"""A robot's description: an MJCF file, and a YAML file with what an MJCF cannot say."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fastswing_planner.arrays import Vector, finite_vector, unique_known
from fastswing_planner.errors import InvalidRequest, RobotDescriptionError
from fastswing_planner.robot.board_groups import BoardGroup, board_groups
from fastswing_planner.robot.learned_model import LearnedMuscleModel, mjcf_hash
from fastswing_planner.robot.length_correction import load_correction
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel, load_mjcf
from fastswing_planner.robot.muscle_model import MuscleModel
from fastswing_planner.robot.path import resolve_path

_REQUIRED = (
    "mjcf",
    "joints",
    "muscles",
    "velocity_limit",
    "acceleration_limit",
    "tension_min",
    "tension_max",
    "tension_limit",
    "current_limit",
    "wire_stiffness",
    "payload_body",
    "postures",
)
_OPTIONAL = ("keyframe", "plant", "board_groups", "learned_muscles")
_LIMITS = ("velocity_limit", "acceleration_limit", "tension_min", "tension_max")
_ROUNDING = 1e-6  # [rad] of an angle or range written with few digits


@dataclass(frozen=True)
class Robot:
    """One arm.

    mjcf            the MJCF file
    model           kinematics and statics of the chosen joints and muscles
    limits          what plans may use
    tension_limit   [N] the boards pay out above it, shape (m,)
    current_limit   [A] shape (m,)
    wire_stiffness  [N/m] of wire and series elasticity, shape (m,)
    payload_body    the body that carries a payload unless a request names another
    postures        named postures [rad], each shape (n,)
    plant           physical constants of the mock arm; not used on a robot
    board_groups    which boards share a bus; one group unless the description says otherwise
    """

    path: Path
    mjcf: Path
    model: MujocoMuscleModel | LearnedMuscleModel
    limits: MuscleLimits
    tension_limit: Vector
    current_limit: Vector
    wire_stiffness: Vector
    payload_body: str
    postures: Mapping[str, Vector]
    plant: Mapping[str, Any]
    board_groups: tuple[BoardGroup, ...]


def load_robot(uri: str | Path) -> Robot:
    """Read a robot's YAML file, a path or `package://PACKAGE/PATH`, and the MJCF beside it.

    Four keys are optional: `keyframe`, the MJCF's keyframe that holds the joints left out (without
    it they are at zero), `plant`, `board_groups`, and `learned_muscles`, a file of learn_model that
    corrects the MJCF's muscle lengths.

    Raises RobotDescriptionError naming file, key, value and remedy.
    """
    path = resolve_path(uri)
    if path.suffix == ".xml" and path.is_file():
        raise RobotDescriptionError(f"{path}: give the YAML file beside this MJCF, not itself")
    try:
        content = yaml.safe_load(path.read_text())
    except FileNotFoundError as error:
        raise RobotDescriptionError(
            f"{path}: no such file; give the YAML file of your robot: robot_description, --robot"
        ) from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RobotDescriptionError(
            f"{path}: not a readable YAML file: {_one_line(error)}"
        ) from error
    if not isinstance(content, dict):
        raise RobotDescriptionError(f"{path}: expected a mapping with {', '.join(_REQUIRED)}")
    for key in content:
        if key not in _REQUIRED + _OPTIONAL:
            raise RobotDescriptionError(
                f"{path}: unknown key '{key}', choose from: {', '.join(_REQUIRED + _OPTIONAL)}"
            )
    # Afterwards: a misspelt key is both.
    for key in _REQUIRED:
        if key not in content:
            raise RobotDescriptionError(f"{path}: key '{key}' is missing")
    try:
        return _build(path, content)
    except (InvalidRequest, RobotDescriptionError) as error:
        raise RobotDescriptionError(f"{path}: {_one_line(error)}") from error


def _one_line(error: Exception) -> str:
    """Return what PyYAML and MuJoCo tell in several lines, for a log."""
    return " ".join(str(error).split())


def _build(path: Path, content: dict[str, Any]) -> Robot:
    mjcf = path.parent / str(content["mjcf"])
    if not mjcf.is_file():
        raise RobotDescriptionError(
            f"key 'mjcf' is {content['mjcf']!r}: {mjcf} is no file; write the MJCF's path, "
            "seen from this file's folder"
        )
    joints = _names(content, "joints")
    muscles = _names(content, "muscles")
    model = _model(path, mjcf, content, joints, muscles)
    plant = content.get("plant") or {}
    if not isinstance(plant, dict):
        raise RobotDescriptionError(f"key 'plant' is {plant!r}, expected a mapping of constants")
    limits = muscle_limits(muscles, *(_numbers(content, key, muscles) for key in _LIMITS))
    return Robot(
        path=path,
        mjcf=mjcf,
        model=model,
        limits=limits,
        tension_limit=_tension_limit(content, muscles, limits),
        current_limit=_positive(content, "current_limit", muscles),
        wire_stiffness=_positive(content, "wire_stiffness", muscles),
        payload_body=_body(_text(content, "payload_body"), model.body_names),
        postures=_postures(content["postures"], model),
        plant=plant,
        board_groups=board_groups(content.get("board_groups"), muscles, joints),
    )


def _model(
    path: Path,
    mjcf: Path,
    content: dict[str, Any],
    joints: tuple[str, ...],
    muscles: tuple[str, ...],
) -> MujocoMuscleModel | LearnedMuscleModel:
    keyframe = _text(content, "keyframe")
    learned = _text(content, "learned_muscles")
    if not learned:
        return MujocoMuscleModel(load_mjcf(mjcf), joints, muscles, keyframe)
    correction = load_correction(path.parent / learned, joints, muscles, mjcf_hash(mjcf))
    plain = MujocoMuscleModel(load_mjcf(mjcf), joints, muscles, keyframe)
    return LearnedMuscleModel(plain, correction)


def _names(content: dict[str, Any], key: str) -> tuple[str, ...]:
    names = content[key]
    listed = isinstance(names, list) and len(names) > 0
    if not listed or not all(isinstance(name, str) for name in names):
        raise RobotDescriptionError(f"key '{key}' is {names!r}, expected a list of names")
    return tuple(names)


def _text(content: dict[str, Any], key: str) -> str:
    text = content.get(key, "")
    if not isinstance(text, str):
        raise RobotDescriptionError(f"key '{key}' is {text!r}, expected a name")
    return text


def _body(name: str, body_names: Sequence[str]) -> str:
    try:
        unique_known("body", [name], body_names)
    except InvalidRequest as error:
        raise RobotDescriptionError(f"key 'payload_body': {error}") from error
    return name


def _postures(postures: Any, model: MuscleModel) -> dict[str, Vector]:
    if not isinstance(postures, dict):
        raise RobotDescriptionError("key 'postures' must map names to lists of angles [rad]")
    if "home" not in postures:
        raise RobotDescriptionError("key 'postures' lacks 'home', the posture of an arm at rest")
    return {str(name): _posture(str(name), angles, model) for name, angles in postures.items()}


def _posture(name: str, angles: Any, model: MuscleModel) -> Vector:
    try:
        posture = finite_vector(f"posture '{name}'", angles, model.joint_names)
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, InvalidRequest):
            raise
        raise RobotDescriptionError(
            f"posture '{name}' is {angles!r}, expected a list of angles [rad]"
        ) from error
    ranges = zip(model.joint_names, posture, model.joint_lower, model.joint_upper, strict=True)
    for joint, angle, low, high in ranges:
        if not low - _ROUNDING <= angle <= high + _ROUNDING:
            raise RobotDescriptionError(
                f"posture '{name}' of {joint} is {angle:g} rad, the MJCF allows {low:g} to {high:g}"
            )
    return posture


def _numbers(content: dict[str, Any], key: str, muscles: tuple[str, ...]) -> Vector:
    """Return one number for each muscle, infinity and NaN included."""
    value = content[key]
    values = value if isinstance(value, list) else [value] * len(muscles)
    numbers = all(type(item) in (int, float) for item in values)
    if not numbers or len(values) != len(muscles):
        raise RobotDescriptionError(
            f"key '{key}' is {value!r}, expected one number, or {len(muscles)} for "
            f"{', '.join(muscles)}"
        )
    # float() of an enormous integer is an error; as a text it is infinity.
    return np.array([float(str(item)) for item in values])


def _positive(content: dict[str, Any], key: str, muscles: tuple[str, ...]) -> Vector:
    vector = finite_vector(f"key '{key}'", _numbers(content, key, muscles), muscles)
    if not np.all(vector > 0):
        raise RobotDescriptionError(f"key '{key}' is {content[key]!r}, must be positive")
    return vector


def _tension_limit(
    content: dict[str, Any], muscles: tuple[str, ...], limits: MuscleLimits
) -> Vector:
    tension_limit = _positive(content, "tension_limit", muscles)
    for name, limit, planned in zip(muscles, tension_limit, limits.tension_max, strict=True):
        if limit < planned:
            raise RobotDescriptionError(
                f"key 'tension_limit' of {name} is {limit:g} N, must not be below its tension_max "
                f"{planned:g} N: the boards would pay out what a plan asks for"
            )
    return tension_limit
