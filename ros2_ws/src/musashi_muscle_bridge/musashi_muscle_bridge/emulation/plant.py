"""The arm that is not here: winches, elastic wires and MuJoCo's arm; without clock or I/O."""

from typing import NamedTuple

import mujoco
import numpy as np

from fastswing_planner.arrays import (
    BoolVector,
    Vector,
    constant,
    contiguous,
    read_only,
    unique_known,
)
from fastswing_planner.planning.ramp import ramp_bounds
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.mujoco_model import load_mjcf, object_names, sparse_places
from musashi_muscle_bridge.emulation.motor_heat import MotorHeat
from musashi_muscle_bridge.emulation.plant_constants import plant_constants

_HEAT_PERIOD = 0.01  # [s]
_ZERO, _ONE = constant(0.0), constant(1.0)


class Drive(NamedTuple):
    """What the motors do; vectors of shape (m,).

    driven    the winch follows `velocity`; otherwise it feels the wire and `current`
    velocity  [m/s] payout speed asked for
    current   [A] pulling is positive
    """

    driven: BoolVector
    velocity: Vector
    current: Vector


class Plant:
    """n joints, m muscles, advanced by an explicit time step; knows nothing of methods.

    Its properties are what sensors measure, with their noise; read-only.

    wire_broken  muscles whose wire is cut, shape (m,); set it at any time
    """

    def __init__(self, robot: Robot) -> None:
        """Put the arm at rest in posture `home`, wires just slack."""
        self._constants = plant_constants(robot.plant)
        self._mjcf = arm_mjcf(robot)
        self._data = mujoco.MjData(self._mjcf)
        self._look_up(robot)
        self._velocity_limit = robot.limits.velocity
        self._stiffness = robot.wire_stiffness
        self._slowest = -robot.limits.velocity
        self._max_pull = robot.current_limit * self._constants.force_per_current
        self.time_step = float(self._mjcf.opt.timestep)
        self._ramp_gain = robot.limits.acceleration * self.time_step  # [m/s]
        self._make_arrays()
        self._data.qpos[:] = robot.model.full_position(robot.postures["home"])
        mujoco.mj_forward(self._mjcf, self._data)
        count = len(robot.model.muscle_names)
        self._winch = self._path_length[self._tendons].copy()
        self._winch_velocity = np.zeros(count)
        self._asked = np.zeros(count)  # [m/s] the ramped speed that the driven winches are to have
        self._tension = np.zeros(count)
        self._current = np.zeros(count)
        self.wire_broken = np.zeros(count, dtype=bool)
        self._heat = MotorHeat(self._constants, count)
        self._steps_per_heat = max(1, round(_HEAT_PERIOD / self.time_step))
        self._steps = 0
        self._random = np.random.default_rng(self._constants.noise_seed)
        self._measure()

    def _look_up(self, robot: Robot) -> None:
        """Find joints and muscles in MuJoCo's memory, once: each step reads and writes there."""
        joints = object_names(self._mjcf, mujoco.mjtObj.mjOBJ_JOINT, self._mjcf.njnt)
        tendons = object_names(self._mjcf, mujoco.mjtObj.mjOBJ_TENDON, self._mjcf.ntendon)
        chosen = unique_known("joint", robot.model.joint_names, joints)
        self._qpos = contiguous(self._mjcf.jnt_qposadr[chosen])
        self._dof = contiguous(self._mjcf.jnt_dofadr[chosen])
        self._tendons = contiguous(unique_known("muscle", robot.model.muscle_names, tendons))
        self._path_length = self._data.ten_length
        self._path_velocity = self._data.ten_velocity
        self._position, self._speed = self._data.qpos, self._data.qvel
        self._torque = self._data.qfrc_applied
        self._sparse_jacobian = self._data.ten_J
        # Where MuJoCo has the elements of the muscles' Jacobian; its others stay zero.
        places = sparse_places(self._mjcf)[self._tendons]
        self._present = np.flatnonzero(places >= 0)
        self._elements = contiguous(places.reshape(-1)[self._present])
        self._jacobian = np.zeros((len(places), self._mjcf.nv))
        self._flat_jacobian = self._jacobian.reshape(-1)

    def _make_arrays(self) -> None:
        """Make arrays of the numbers that every step needs."""
        constants = self._constants
        self._dt = constant(self.time_step)
        self._wire_damping = constant(constants.wire_damping)
        self._stall_force = constant(constants.stall_force)
        self._stall_exponent = constant(constants.stall_exponent)
        self._force_per_current = constant(constants.force_per_current)
        self._winch_mass = constant(constants.winch_mass)
        self._friction_loss = constant(constants.winch_friction * self.time_step)
        self._damped_mass = constant(
            constants.winch_mass + constants.winch_damping * self.time_step
        )

    @property
    def joint_position(self) -> Vector:
        """Joint angles [rad], shape (n,)."""
        return self._measured_position

    @property
    def joint_velocity(self) -> Vector:
        """Joint speeds [rad/s], shape (n,); without noise."""
        return read_only(self._speed[self._dof].copy())

    @property
    def length(self) -> Vector:
        """Unstretched wire between winch and insertion [m], shape (m,): what encoders read."""
        return self._measured_length

    @property
    def velocity(self) -> Vector:
        """Rate of the unstretched wire [m/s], shape (m,); without quantisation."""
        return self._winch_velocity

    @property
    def tension(self) -> Vector:
        """Wire tensions [N], shape (m,); never negative."""
        return self._measured_tension

    @property
    def current(self) -> Vector:
        """Motor currents [A], shape (m,)."""
        return self._current

    @property
    def housing_temperature(self) -> Vector:
        """Temperatures of the motors' housings [degC], shape (m,)."""
        return self._heat.housing

    def step(self, drive: Drive) -> None:
        """Advance by `time_step`."""
        driven = np.count_nonzero(drive.driven)
        if driven == self._winch.size:
            velocity, current = self._driven(drive)
        else:
            velocity, current = self._back_driven(drive)
            asked = velocity.copy()
            if driven:
                driven_velocity, driven_current = self._driven(drive)
                np.copyto(velocity, driven_velocity, where=drive.driven)
                np.copyto(current, driven_current, where=drive.driven)
                # A winch that is driven again begins at the speed that it has.
                np.copyto(asked, self._asked, where=drive.driven)
            self._asked = asked
        self._winch_velocity, self._current = read_only(velocity), read_only(current)
        self._winch = self._winch + velocity * self._dt
        self._steps += 1
        if self._steps % self._steps_per_heat == 0:
            # Temperatures move slowly: a sample of the current now and then is enough.
            self._heat.add(current, self._steps_per_heat * self.time_step)
        mujoco.mj_step1(self._mjcf, self._data)
        self._pull()
        mujoco.mj_step2(self._mjcf, self._data)
        self._measure()

    def _pull(self) -> None:
        stretch = self._path_length[self._tendons] - self._winch
        rate = self._path_velocity[self._tendons] - self._winch_velocity
        # A slack or broken wire pulls nothing, and damping never pushes.
        pull = self._stiffness * stretch + self._wire_damping * rate
        tension = np.maximum(pull, _ZERO)
        tension[stretch <= _ZERO] = 0.0
        if np.count_nonzero(self.wire_broken):
            tension[self.wire_broken] = 0.0
        self._tension = tension
        self._flat_jacobian[self._present] = self._sparse_jacobian[self._elements]
        # tau = -G^T f
        np.negative(tension.dot(self._jacobian), out=self._torque)

    def _driven(self, drive: Drive) -> tuple[Vector, Vector]:
        low, high = ramp_bounds(self._asked, self._ramp_gain, self._slowest, self._velocity_limit)
        self._asked = np.minimum(np.maximum(drive.velocity, low), high)
        # Winding in, a winch falls behind the more it has to pull, down to standing still.
        share = (self._tension / self._stall_force) ** self._stall_exponent
        velocity = np.maximum(self._asked, self._asked * np.maximum(_ONE - share, _ZERO))
        stalled = self._tension >= self._max_pull
        if np.count_nonzero(stalled):
            np.maximum(velocity, _ZERO, out=velocity, where=stalled)
        pull = np.minimum(self._tension, self._max_pull)
        return velocity, pull / self._force_per_current

    def _back_driven(self, drive: Drive) -> tuple[Vector, Vector]:
        force = self._tension - drive.current * self._force_per_current
        # Implicit in damping and friction: m dv/dt = force - d v - F sign(v), and F holds v at 0.
        free = self._winch_mass * self._winch_velocity + force * self._dt
        moving = np.sign(free) * np.maximum(np.abs(free) - self._friction_loss, _ZERO)
        return moving / self._damped_mass, drive.current.copy()

    def _measure(self) -> None:
        constants = self._constants
        length, tension = self._winch, self._tension
        position = self._position[self._qpos].copy()
        if constants.encoder_step:
            length = np.round(length / constants.encoder_step) * constants.encoder_step
        if constants.tension_noise:
            noise = self._random.normal(0.0, constants.tension_noise, tension.size)
            tension = np.maximum(tension + noise, 0.0)
        if constants.angle_noise:
            position = position + self._random.normal(0.0, constants.angle_noise, position.size)
        self._measured_length = read_only(length)
        self._measured_tension = read_only(tension)
        self._measured_position = read_only(position)


def arm_mjcf(robot: Robot) -> mujoco.MjModel:
    """Compile the arm without actuators of its own: its muscles are the plant's winches.

    Joints that the robot's description leaves out are locked where the planner has them.
    """
    spec = mujoco.MjSpec.from_file(str(robot.mjcf))
    zero = load_mjcf(robot.mjcf)
    for name, position in robot.model.held_joints().items():
        lock = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=name)
        # q - q0 = data[0]  (MuJoCo's XML reference, equality/joint)
        lock.data[:5] = [position - float(zero.joint(name).qpos0[0]), 0.0, 0.0, 0.0, 0.0]
    mjcf = spec.compile()
    mjcf.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    if not (mjcf.geom_contype.any() and mjcf.geom_conaffinity.any()) and not mjcf.npair:
        # Nothing can touch: do not look for contacts.
        mjcf.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return mjcf
