"""Guides a person through signs and length zeros: `ros2 run musashi_muscle_bridge calibrate`."""

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from fastswing_planner.command_line import say
from fastswing_planner.errors import PlannerError, UnknownName
from fastswing_planner.lifecycle.transport import choose_transport
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.calibration import PullSettings, Verdict
from musashi_muscle_bridge.commands.calibrator import Calibrator

_SKIPPED = "skipped"


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
    choose_transport()
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
