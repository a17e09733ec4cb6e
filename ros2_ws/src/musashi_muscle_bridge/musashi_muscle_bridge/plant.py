"""The arm that is not here: winches, elastic wires and MuJoCo's arm; without clock or I/O."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np

from fastswing_planner.arrays import BoolVector, Vector, frozen, unique_known
from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.mujoco_model import load_mjcf, object_names, tendon_jacobian
from fastswing_planner.ramp import velocity_bounds
from fastswing_planner.robot import Robot


@dataclass(frozen=True)
class PlantConstants:
    """Physical constants of every winch; all ours, see docs/musashi_model.md.

    wire_damping        [N s/m] of the stretching wire
    winch_mass          [kg] reflected inertia of motor and gear at the wire
    winch_friction      [N] Coulomb friction of the gear at the wire, felt when back-driven
    winch_damping       [N s/m] viscous part of it
    force_per_current   [N/A] pull at the wire for each ampere
    """

    wire_damping: float = 60.0
    winch_mass: float = 4.0
    winch_friction: float = 10.0
    winch_damping: float = 40.0
    force_per_current: float = 50.0


def plant_constants(content: Mapping[str, Any]) -> PlantConstants:
    """Read a robot's `plant` section; raises RobotDescriptionError naming the key."""
    names = [field.name for field in fields(PlantConstants)]
    for key, value in content.items():
        if key not in names:
            raise RobotDescriptionError(
                f"plant: unknown key '{key}', choose from: {', '.join(names)}"
            )
        if not isinstance(value, (int, float)) or not (np.isfinite(value) and value > 0):
            raise RobotDescriptionError(f"plant: {key} is {value!r}, expected a positive number")
    return PlantConstants(**content)


@dataclass(frozen=True)
class Drive:
    """What the motors do; vectors of shape (m,).

    driven    the winch follows `velocity`; otherwise it feels the wire and `current`
    velocity  [m/s] payout speed asked for
    current   [A] pulling is positive
    """

    driven: BoolVector
    velocity: Vector
    current: Vector


class Plant:
    """n joints, m muscles, advanced by an explicit time step; knows nothing of methods."""

    def __init__(self, robot: Robot) -> None:
        """Put the arm at rest in posture `home`, wires just slack."""
        self._constants = plant_constants(robot.plant)
        self._mjcf = load_mjcf(robot.mjcf)
        self._data = mujoco.MjData(self._mjcf)
        joints = object_names(self._mjcf, mujoco.mjtObj.mjOBJ_JOINT, self._mjcf.njnt)
        tendons = object_names(self._mjcf, mujoco.mjtObj.mjOBJ_TENDON, self._mjcf.ntendon)
        chosen = unique_known("joint", robot.model.joint_names, joints)
        self._qpos = self._mjcf.jnt_qposadr[chosen]
        self._dof = self._mjcf.jnt_dofadr[chosen]
        self._tendons = np.array(unique_known("muscle", robot.model.muscle_names, tendons))
        self._limits = robot.limits
        self._stiffness = robot.wire_stiffness
        self._current_limit = robot.current_limit
        self.time_step = float(self._mjcf.opt.timestep)
        self._data.qpos[self._qpos] = robot.postures["home"]
        mujoco.mj_forward(self._mjcf, self._data)
        self._winch = np.array(self._data.ten_length[self._tendons])
        self._winch_velocity = np.zeros(self._winch.size)
        self._tension = np.zeros(self._winch.size)
        self._current = np.zeros(self._winch.size)
        self.wire_broken = np.zeros(self._winch.size, dtype=bool)  # pulls nothing

    @property
    def joint_position(self) -> Vector:
        """Joint angles [rad], shape (n,)."""
        return frozen(self._data.qpos[self._qpos])

    @property
    def joint_velocity(self) -> Vector:
        """Joint speeds [rad/s], shape (n,)."""
        return frozen(self._data.qvel[self._dof])

    @property
    def length(self) -> Vector:
        """Unstretched wire between winch and insertion [m], shape (m,): what encoders read."""
        return frozen(self._winch)

    @property
    def velocity(self) -> Vector:
        """Rate of `length` [m/s], shape (m,)."""
        return frozen(self._winch_velocity)

    @property
    def tension(self) -> Vector:
        """Wire tensions [N], shape (m,)."""
        return frozen(self._tension)

    @property
    def current(self) -> Vector:
        """Motor currents [A], shape (m,)."""
        return frozen(self._current)

    def step(self, drive: Drive) -> None:
        """Advance by `time_step`."""
        self._move_winches(drive)
        mujoco.mj_step1(self._mjcf, self._data)
        stretch = self._data.ten_length[self._tendons] - self._winch
        rate = self._data.ten_velocity[self._tendons] - self._winch_velocity
        # A slack wire pulls nothing, and damping never pushes.
        pull = self._stiffness * stretch + self._constants.wire_damping * rate
        self._tension = np.where((stretch > 0.0) & ~self.wire_broken, np.maximum(pull, 0.0), 0.0)
        jacobian = tendon_jacobian(self._mjcf, self._data)[self._tendons]
        # tau = -G^T f
        self._data.qfrc_applied[:] = -jacobian.T @ self._tension
        mujoco.mj_step2(self._mjcf, self._data)

    def _move_winches(self, drive: Drive) -> None:
        velocity = np.where(drive.driven, self._driven(drive), self._back_driven(drive))
        self._winch += velocity * self.time_step
        self._winch_velocity = velocity

    def _driven(self, drive: Drive) -> Vector:
        low, high = velocity_bounds(
            self._winch_velocity, self._limits.velocity, self._limits.acceleration, self.time_step
        )
        velocity = np.clip(drive.velocity, low, high)
        # At the current limit the motor cannot pull any harder: it stalls.
        needed = self._tension / self._constants.force_per_current
        stalled = (needed >= self._current_limit) & (velocity < 0.0)
        self._current = np.where(drive.driven, np.minimum(needed, self._current_limit), 0.0)
        return np.where(stalled, 0.0, velocity)

    def _back_driven(self, drive: Drive) -> Vector:
        constants = self._constants
        self._current = np.where(drive.driven, self._current, drive.current)
        force = self._tension - drive.current * constants.force_per_current
        # Implicit in damping and friction: m dv/dt = force - d v - F sign(v), and F holds v at 0.
        free = constants.winch_mass * self._winch_velocity + force * self.time_step
        held = constants.winch_friction * self.time_step
        moving = np.sign(free) * np.maximum(np.abs(free) - held, 0.0)
        return moving / (constants.winch_mass + constants.winch_damping * self.time_step)
