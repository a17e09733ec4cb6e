"""Guides a person through signs and length zeros: `ros2 run musashi_muscle_bridge calibrate`."""

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import CurrentCommand, MuscleState
from fastswing_planner.command_line import say
from fastswing_planner.conversion.states import JointStateReader
from fastswing_planner.errors import NotReady, PlannerError, StaleState, UnknownName
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.calibration import (
    MuscleReading,
    Pull,
    PullSettings,
    Verdict,
    length_offsets,
)

_SPIN_SEC = 0.005
# As all nodes: managed_node.py says why.
_TRANSPORT = ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
_FIRST_STATES_SEC = 10.0
_STALE_SEC = 0.5
_PULL_STALE_SEC = 0.1  # the bridge's own limits of a current hold meanwhile
_SETTLE_STATES = 20  # what waited while the person read is old
_SKIPPED = "skipped"


class Calibrator:
    """Pulls one muscle at a time by `current_command`, and reads the states."""

    def __init__(self, robot: Robot, settings: PullSettings) -> None:
        """Connect; rclpy must be running."""
        self._robot = robot
        self._settings = settings
        self._muscles: MuscleState | None = None
        self._posture: Any = None
        self._states, self._seen = 0, time.monotonic()
        self._node = Node("calibrate", start_parameter_services=False)
        self._reader = JointStateReader(robot.model.joint_names)
        self._commands = self._node.create_publisher(CurrentCommand, "current_command", 10)
        newest = QoSProfile(depth=1)
        self._node.create_subscription(MuscleState, "muscle_state", self._on_muscles, newest)
        self._node.create_subscription(
            JointState, "joint_states", self._on_joints, qos_profile_sensor_data
        )
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)

    def _on_muscles(self, message: MuscleState) -> None:
        self._muscles = message
        self._states += 1
        self._seen = time.monotonic()

    def _on_joints(self, message: JointState) -> None:
        self._posture = self._reader.read(message, time.monotonic()).position

    def close(self) -> None:
        """Disconnect; without a stream the muscle holds."""
        self._node.destroy_node()

    def fresh(self, timeout: float = _STALE_SEC) -> MuscleState:
        """Return states that were measured just now.

        Raises StaleState if none come within `timeout` [s], NotReady for a fault, for muscles that
        do not hold a length by then, or if somebody else commands currents.
        """
        self._states, self._seen = 0, time.monotonic()
        begin = self._seen
        while (
            self._states < _SETTLE_STATES
            or self._posture is None
            or (self._not_held() and time.monotonic() < begin + timeout)
        ):
            self._executor.spin_once(timeout_sec=_SPIN_SEC)
            self._refuse_silence(timeout)
        assert self._muscles is not None
        if list(self._muscles.name) != list(self._robot.model.muscle_names):
            raise UnknownName("the bridge has other muscles: set --robot to its description")
        faulty = [
            name
            for name, fault in zip(self._muscles.name, self._muscles.fault, strict=True)
            if fault
        ]
        if faulty:
            raise NotReady(
                f"faulty muscles: {', '.join(faulty)}; find the cause, then clear_faults"
            )
        if loose := self._not_held():
            raise NotReady(
                f"muscles that do not hold a length: {', '.join(loose)}; end an emergency stop "
                "with clear_faults, or what else drives them; is the bridge read only?"
            )
        if self._node.count_publishers("current_command") > 1:
            raise NotReady("somebody else publishes current_command: end it first")
        return self._muscles

    def _not_held(self) -> list[str]:
        if self._muscles is None:
            return []
        modes = zip(self._muscles.name, self._muscles.mode, strict=True)
        return [name for name, mode in modes if mode != MuscleState.MODE_LENGTH]

    def _refuse_silence(self, timeout: float) -> None:
        silence = time.monotonic() - self._seen
        if silence > timeout:
            raise StaleState(
                f"no muscle_state for {silence:.1f} s: is the bridge active, do its boards answer?"
            )

    def offsets(self) -> dict[str, float]:
        """Return what to add to each muscle's length [m]; see `length_offsets`."""
        state = self.fresh(_FIRST_STATES_SEC)
        offsets = length_offsets(
            self._robot.model.lengths(self._posture),
            np.array(state.length),
            np.array(state.tension),
            self._robot.wire_stiffness,
        )
        return dict(zip(self._robot.model.muscle_names, offsets.tolist(), strict=True))

    def pull(self, name: str) -> Pull:
        """Pull one muscle; returns the finished pull. Raises as `fresh` does."""
        index = self._robot.model.muscle_names.index(name)
        before = _reading(self.fresh(), index)
        pull = Pull(self._settings, before, float(self._robot.current_limit[index]))
        current = pull.step(before)
        while current is not None:
            stamp = self._node.get_clock().now().to_msg()
            command = CurrentCommand(header=Header(stamp=stamp), name=[name], current=[current])
            self._commands.publish(command)
            self._executor.spin_once(timeout_sec=_SPIN_SEC)
            self._refuse_silence(_PULL_STALE_SEC)
            assert self._muscles is not None
            current = pull.step(_reading(self._muscles, index))
        return pull


def _reading(state: MuscleState, index: int) -> MuscleReading:
    return MuscleReading(
        time.monotonic(),
        state.length[index],
        state.tension[index],
        state.current[index],
        state.mode[index] == MuscleState.MODE_CURRENT,
        bool(any(state.fault)),
    )


def guide(
    calibrator: Calibrator, muscles: Sequence[str], ask: Callable[[str], str]
) -> dict[str, dict[str, Any]]:
    """Ask and pull muscle by muscle; return what was found by name, those not reached left out."""
    ask("Support the arm, every wire taut, nobody's hand in it. Enter goes on, q ends: ")
    offsets = calibrator.offsets()
    found: dict[str, dict[str, Any]] = {}
    for name in muscles:
        answer = ask(f"{name}: Enter pulls it gently, s skips it, q ends: ")
        if answer == "s":
            found[name] = {"verdict": _SKIPPED}
            continue
        pull = calibrator.pull(name)
        assert pull.verdict is not None
        say(f"{name}: {pull.verdict.value} ({pull.rise:+.1f} N, {-1e3 * pull.shortening:+.2f} mm)")
        found[name] = {
            "verdict": pull.verdict.name.lower(),
            "tension_rise": round(pull.rise, 2),
            "shortening": round(pull.shortening, 6),
            "length_offset": round(offsets[name], 5) + 0.0,  # no -0.0
        }
    return found


class _Ended(Exception):
    """The person ended it."""


def _ask(question: str) -> str:
    print(question, end="", flush=True)
    answer = sys.stdin.readline()
    if not answer or answer.strip().lower() == "q":
        raise _Ended
    return answer.strip().lower()


def _arguments(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="calibrate", description=__doc__)
    parser.add_argument("--robot", default=MUSASHI, help="YAML file of the robot, or package://")
    parser.add_argument("--muscles", nargs="+", help="only these, by name")
    parser.add_argument("--output", type=Path, required=True, help="new YAML file of what is found")
    parser.add_argument(
        "--current", type=float, default=PullSettings.current_step, help="of a pull [A], up to 2"
    )
    chosen = parser.parse_args(arguments)
    if not 0.0 < chosen.current <= 2.0:
        parser.error(f"--current is {chosen.current}, expected more than 0, up to 2 A")
    if chosen.output.exists():
        parser.error(f"{chosen.output} exists, and is not overwritten")
    return chosen


def main() -> int:
    """Run the command; returns 0 if every muscle asked for is sound, else 1, 2 for wrong input."""
    chosen = _arguments(remove_ros_args(sys.argv)[1:])
    try:
        robot = load_robot(chosen.robot)
        names = robot.model.muscle_names
        muscles = chosen.muscles or list(names)
        for name in muscles:
            if name not in names:
                raise UnknownName(f"unknown muscle '{name}', choose from: {', '.join(names)}")
    except PlannerError as error:
        print(f"calibrate: {error}", file=sys.stderr)
        return 2
    os.environ.setdefault(*_TRANSPORT)
    for number in (signal.SIGINT, signal.SIGTERM):
        # Also where a shell had them ignored: whoever ends this wants no muscle pulled any more.
        signal.signal(number, signal.default_int_handler)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    calibrator = Calibrator(robot, PullSettings(current_step=chosen.current))
    found: dict[str, dict[str, Any]] = {}
    try:
        found = guide(calibrator, muscles, _ask)
    except PlannerError as error:
        print(f"calibrate: {error}", file=sys.stderr)
    except (_Ended, KeyboardInterrupt):
        say("ended; nothing is written")
    finally:
        calibrator.close()
        rclpy.try_shutdown()
    if not found:
        return 1
    chosen.output.write_text(
        yaml.safe_dump({"muscles": found}, sort_keys=False, allow_unicode=True)
    )
    say(f"written: {chosen.output}")
    sound = all(one["verdict"] == Verdict.SOUND.name.lower() for one in found.values())
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
