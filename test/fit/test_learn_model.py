"""From a bag of an arm whose muscle paths are off by 10 mm, its true Jacobian is learned."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import MuscleState
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.commands.learn_model import main
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.errors import OutOfRange
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.muscle_model import MuscleModel
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.buses.protocol import COMMAND_ROW, CommandFrame, Mode, WatchdogAction
from musashi_muscle_bridge.emulation.boards import Boards

PATH_ERROR = 0.010
"""[m] every point of every muscle path is off by, in a direction of its own."""
LOW = np.array([-0.95, -0.2, -0.2, -2.1, -0.2])
HIGH = np.array([-0.2, 0.2, 0.2, -0.4, 0.2])
DURATION = 120.0  # [s]
PERIOD = 0.002  # [s]
RECORD_EVERY = 10
TENSION = 60.0  # [N] beyond what the posture needs
START_NS = 1_700_000_000_000_000_000
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/muscle_state": "fastswing_msgs/msg/MuscleState",
}


def perturbed_robot(robot: Robot, folder: Path, seed: int) -> Robot:
    """Return the robot with other muscle paths."""
    random = np.random.default_rng(seed)
    spec = mujoco.MjSpec.from_file(str(robot.mjcf))
    for site in spec.sites:
        way = random.normal(size=3)
        site.pos = np.array(site.pos) + PATH_ERROR * way / np.linalg.norm(way)
    (folder / "arm.xml").write_text(spec.to_xml())
    content = yaml.safe_load(robot.path.read_text())
    content["mjcf"] = "arm.xml"
    (folder / "arm.yaml").write_text(yaml.safe_dump(content))
    return load_robot(folder / "arm.yaml")


def record_motion(robot: Robot, path: Path) -> Matrix:
    """Move the emulated arm about for a while and record it; returns its postures [rad]."""
    bag = BagWriter(path)
    for name, kind in TYPES.items():
        bag.add_topic(BagTopic(name, kind, definition_text(kind)))
    boards = Boards(robot)
    count = len(robot.model.muscle_names)
    rows = np.zeros(count, dtype=COMMAND_ROW)
    rows["mode"], rows["id"] = Mode.LENGTH, np.arange(count)
    rows["tension_limit"], rows["current_limit"] = robot.tension_limit, robot.current_limit
    postures = []
    for step in range(round(DURATION / PERIOD)):
        time = step * PERIOD
        if step % 5 == 0:
            aim = robot.model.lengths(motion(time))
            rows["setpoint"] = aim - TENSION / robot.wire_stiffness
        command = CommandFrame(step, rows, WatchdogAction.HOLD_LENGTH, 1.0)
        state = boards.handle(command)
        boards.advance(PERIOD)
        if step % RECORD_EVERY == 0 and time > 3.0:
            postures.append(state.joints["position"].astype(float))
            put(bag, robot, START_NS + round(time * 1e9), state)
    bag.close()
    return np.array(postures)


def motion(time: float) -> Vector:
    """Return the commanded posture [rad]: raised first, then about in the region."""
    rates = np.array([0.61, 0.83, 1.07, 0.47, 1.31])
    slow = np.array([0.13, 0.29, 0.23, 0.19, 0.17])
    phase = np.arange(5.0)
    wave = 0.5 * np.sin(rates * time + phase) + 0.5 * np.sin(slow * time + 2.0 * phase)
    raised = (LOW + HIGH) / 2.0 + (HIGH - LOW) / 2.0 * wave
    return np.asarray(raised * min(time / 3.0, 1.0))


def put(bag: BagWriter, robot: Robot, time_ns: int, state: Any) -> None:
    header = Header()
    header.stamp.sec, header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
    joints = JointState(
        header=header,
        name=robot.model.joint_names,
        position=state.joints["position"].tolist(),
        velocity=state.joints["velocity"].tolist(),
    )
    muscles = MuscleState(
        header=header,
        name=robot.model.muscle_names,
        length=state.rows["length"].tolist(),
        velocity=state.rows["velocity"].tolist(),
        tension=state.rows["tension"].tolist(),
        current=state.rows["current"].tolist(),
        temperature=state.rows["temperature"].tolist(),
        mode=state.rows["mode"].tolist(),
        fault=state.rows["fault"].tolist(),
    )
    for name, message in zip(TYPES, (joints, muscles), strict=True):
        bag.write(name, bytes(serialize_message(message)), time_ns, time_ns)


@dataclass
class Learned:
    """What was learned, and from what."""

    plain: Robot
    true: Robot
    learned: Robot
    postures: Matrix
    folder: Path


@pytest.fixture(scope="module", params=[0, 1], ids=["arm 0", "arm 1"])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Learned:
    folder = tmp_path_factory.mktemp("arm")
    plain = load_robot(MUSASHI)
    true = perturbed_robot(plain, folder, request.param)
    postures = record_motion(true, folder / "motion.mcap")
    arguments = [str(folder / "motion.mcap"), "--robot", str(plain.path)]
    assert main([*arguments, "-o", str(folder / "learned.yaml")]) == 0
    return Learned(plain, true, load_robot(folder / "learned.yaml"), postures, folder)


def jacobian_error(model: MuscleModel, case: Learned) -> float:
    """Return the root mean square over recorded postures, muscles and joints [m/rad]."""
    return float(
        np.sqrt(
            np.mean(
                [
                    (model.jacobian(posture) - case.true.model.jacobian(posture)) ** 2
                    for posture in case.postures[::25]
                ]
            )
        )
    )


def predicted_time(robot: Robot) -> float:
    """Return the predicted time of the basic swing [s], in steps of 2 ms: the paper's hide it."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    start, end = robot.postures["start"], robot.postures["end"]
    settings = SwingSettings(time_step=0.002, max_steps=2000)
    return planner.plan(SwingRequest(start, end, settings=settings)).time_cost


def test_the_jacobian_is_five_times_nearer(case: Learned) -> None:
    before = jacobian_error(case.plain.model, case)
    after = jacobian_error(case.learned.model, case)
    assert after < before / 5.0


def test_its_muscles_lengthen_as_the_learned_jacobian_says(case: Learned) -> None:
    model, posture, speeds = case.learned.model, case.postures[10], [1.0, -0.5, 2.0, 0.3, -1.0]
    expected = model.jacobian(posture) @ speeds
    assert model.muscle_velocity(posture.tolist(), speeds) == pytest.approx(expected, abs=1e-12)


def test_the_predicted_time_is_nearer(case: Learned) -> None:
    true = predicted_time(case.true)
    before = abs(predicted_time(case.plain) - true)
    after = abs(predicted_time(case.learned) - true)
    assert after < before / 2.0


def test_where_nothing_was_recorded_it_refuses(case: Learned) -> None:
    with pytest.raises(OutOfRange, match="the learned muscle lengths do not reach"):
        case.learned.model.jacobian(np.array([0.9, 0.0, 0.0, 0.0, 1.0]))


def test_gravity_is_that_of_the_mjcf(case: Learned) -> None:
    posture = case.postures[0]
    np.testing.assert_array_equal(
        case.learned.model.gravity_torque(posture), case.plain.model.gravity_torque(posture)
    )
