"""The demo's results: what is read from a swing's bag, and how table, picture and page show it."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from matplotlib.image import imread
from paper_values import PAPER
from rclpy.serialization import serialize_message
from report import table_text, write_report
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from swing_bag import UnusableBag, read_swing, read_swings
from swing_picture import draw_figure, draw_swing

from fastswing_msgs.msg import (
    CurrentOverride,
    LengthCommand,
    MuscleState,
    SwingPlan,
    SwingTrajectory,
)
from fastswing_planner.analysis.motor_limits import MotorLimit
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text

ROOT = Path(__file__).parents[2]

ROBOT = ROOT / "ros2_ws/src/musashi_muscle_bridge/description/musashi_left_arm.yaml"
JOINTS = ["S-p", "S-r", "S-y", "E-p", "E-y"]
MUSCLES = [f"#{number}" for number in range(1, 11)]
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/muscle_state": "fastswing_msgs/msg/MuscleState",
    "/length_command": "fastswing_msgs/msg/LengthCommand",
    "/current_override": "fastswing_msgs/msg/CurrentOverride",
    "/swing_plan": "fastswing_msgs/msg/SwingPlan",
}
EPOCH = 1_700_000_000
SWING = 4.0
"""[s] after EPOCH, when the swing is commanded."""


def header(seconds: float) -> Header:
    nanoseconds = round(seconds * 1e9)
    stamp = Time(sec=EPOCH + nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
    return Header(stamp=stamp)


class SwingBag:
    """Writes the bag of a swing: 2 s raising at 0.8 rad/s, rest, and at SWING the swing."""

    def __init__(self, path: Path, peak: float = 3.0, namespace: str = "") -> None:
        self._bag = BagWriter(path)
        self._prefix = namespace
        self.peak = peak
        for topic, kind in TYPES.items():
            self._bag.add_topic(BagTopic(namespace + topic, kind, definition_text(kind)))

    def add(self, topic: str, seconds: float, message: Any, delay: float = 0.002) -> None:
        """Record `message`, stamped `seconds` after EPOCH and received `delay` [s] later."""
        message.header = header(seconds)
        received = EPOCH * 10**9 + round((seconds + delay) * 1e9)
        self._bag.write(
            self._prefix + topic, bytes(serialize_message(message)), received, received - 10**6
        )

    def elbow_speed(self, seconds: float) -> float:
        """Return the elbow's speed [rad/s]: raising, at rest, then one arch of 1 s."""
        if seconds < 2.0:
            return -0.8
        if not SWING < seconds < SWING + 1.0:
            return 0.0
        return self.peak * float(np.sin(np.pi * (seconds - SWING)))

    def states(self, later: float = 0.0) -> None:
        for begun in np.arange(0.0, 6.0, 0.01):
            speed, seconds = self.elbow_speed(begun), begun + later
            velocity = [0.0, 0.0, 0.0, speed, 0.0]
            self.add("/joint_states", seconds, JointState(name=JOINTS, velocity=velocity))
            muscles = MuscleState(name=MUSCLES)
            muscles.velocity = [speed * 0.01 * index for index in range(10)]
            muscles.tension = [20.0 + 50.0 * abs(speed)] * 10
            self.add("/muscle_state", seconds, muscles)

    def commands(self) -> None:
        """Many small steps up, none at rest, one large step for the swing, and it again."""
        lengths = np.zeros(10)
        for seconds in np.arange(0.0, 2.0, 0.01):
            lengths = lengths + 0.0004
            self.command(seconds, lengths)
        self.command(SWING, lengths - 0.1)
        self.command(SWING + 1.2, lengths - 0.1)

    def command(self, seconds: float, lengths: "np.ndarray[Any, Any]") -> None:
        message = LengthCommand(name=MUSCLES, length=lengths.tolist())
        self.add("/length_command", seconds, message)

    def plan(self, masked: list[str], seconds: float = 0.1) -> None:
        steps = [0.0, 0.3, 0.6, 0.9]
        trajectory = SwingTrajectory(
            time_from_start=steps,
            joint_velocity=[v for step in steps for v in (0.05, 0.0, 0.0, 2 * step, 0.0)],
        )
        mask = [int(name not in masked) for name in MUSCLES]
        message = SwingPlan(joint_name=JOINTS, muscle_name=MUSCLES, mask=mask)
        message.trajectory = trajectory
        message.start_position, message.end_position = [0.0] * 5, [0.0, 0.0, 0.0, 1.9, 0.0]
        message.elongation = [0.0] * 10
        self.add("/swing_plan", seconds, message)

    def override(self, seconds: float, names: list[str], lease: float = 0.1) -> None:
        nanoseconds = round(lease * 1e9)
        message = CurrentOverride(name=names, lease=Duration(nanosec=nanoseconds))
        self.add("/current_override", seconds, message, delay=0.0)

    def close(self) -> None:
        self._bag.close()


def write_swing(path: Path, masked: list[str], peak: float = 3.0) -> Path:
    bag = SwingBag(path, peak)
    bag.plan(masked)
    bag.commands()
    bag.states()
    bag.close()
    return path


def summary() -> dict[str, Any]:
    def figures(speed: float, time: float, muscle: float, tension: float | None) -> dict[str, Any]:
        return {
            "peak_elbow_pitch_velocity_rad_s": speed,
            "time_cost_s": time,
            "max_muscle_velocity_m_s": muscle,
            "max_tension_n": tension,
        }

    return {
        "methods": {
            "basic": {
                "predicted": figures(2.408, 0.99, 0.3, None),
                "measured": figures(2.71, 1.02, 0.294, 225.4),
                "masked_muscles": [],
                "bag": "basic.mcap",
            },
            "method_1": {
                "predicted": figures(4.39, 0.6, 0.5, None),
                "measured": figures(3.84, 0.71, 0.45, 176.0),
                "masked_muscles": ["#2", "#3", "#9", "#10"],
                "bag": "method_1.mcap",
            },
            "method_2": {
                "predicted": figures(3.3, 0.78, 0.3, None),
                "measured": figures(3.28, float("nan"), 0.301, 157.0),
                "masked_muscles": ["#9"],
                "bag": "method_2.mcap",
            },
        },
        "paper": PAPER,
    }


# Reading a bag. What is found in one is tested where it is done, in the planner's tests.


def test_time_zero_is_the_swing_command_and_not_the_way_up(tmp_path: Path) -> None:
    swing = read_swing(write_swing(tmp_path / "a.mcap", []))
    assert swing.commanded
    assert swing.joint_series.time[0] == pytest.approx(-0.1, abs=0.01)
    assert swing.start == pytest.approx(SWING - 0.002, abs=1e-6)


def test_of_several_swings_the_fastest_is_shown(tmp_path: Path) -> None:
    bag = SwingBag(tmp_path / "a.mcap")
    bag.states()
    bag.peak = 5.0
    bag.states(later=10.0)
    bag.close()
    assert read_swing(tmp_path / "a.mcap").main_joint.peak_speed == pytest.approx(5.0, rel=1e-3)


def test_a_bag_without_joint_states_is_named(tmp_path: Path) -> None:
    bag = SwingBag(tmp_path / "a.mcap")
    bag.commands()
    bag.close()
    with pytest.raises(UnusableBag, match=r"a\.mcap holds no joint states"):
        read_swing(tmp_path / "a.mcap")


def test_a_bag_without_a_swing_says_how_fast_the_arm_was(tmp_path: Path) -> None:
    with pytest.raises(UnusableBag, match=r"no swing: the fastest joint, E-p, reached 0\.80 rad/s"):
        read_swing(write_swing(tmp_path / "a.mcap", [], peak=0.5))


@pytest.mark.parametrize("content", [None, b"", b"not a bag at all, but long enough for a footer"])
def test_what_is_no_bag_is_named(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(UnusableBag, match=r"a\.mcap"):
        read_swing(tmp_path / "a.mcap")


# The picture.


def write_three(tmp_path: Path) -> dict[str, Path]:
    second = SwingBag(tmp_path / "method_1.mcap", peak=3.7)
    second.plan(["#2", "#3", "#9", "#10"])
    second.commands()
    second.states()
    for index in range(30):
        second.override(SWING + 0.02 * index, ["#2", "#3", "#9", "#10"])
    second.override(SWING + 0.6, [])
    second.close()
    return {
        "basic": write_swing(tmp_path / "basic.mcap", [], 2.6),
        "method_1": tmp_path / "method_1.mcap",
        "method_2": write_swing(tmp_path / "method_2.mcap", ["#9"], 3.4),
    }


def test_the_picture_is_large_enough_to_read(tmp_path: Path) -> None:
    output = tmp_path / "out" / "swing.png"
    draw_swing(write_three(tmp_path), output, ROBOT)
    picture = imread(output)
    assert picture.shape[:2] == (1000, 1600)
    assert picture[..., :3].std() > 0.05


def test_the_picture_has_axes_with_units_and_one_scale_in_each_row(tmp_path: Path) -> None:
    limits = dict.fromkeys(MUSCLES, MotorLimit(0.3, 200.0, 450.0))
    figure = draw_figure(read_swings(write_three(tmp_path)), limits)
    axes = np.array(figure.axes).reshape(3, 3)
    assert [row[0].get_ylabel().split("\n")[0] for row in axes] == [
        "joint speed [rad/s]",
        "muscle speed [m/s]",
        "muscle tension [N]",
    ]
    assert [one.get_xlabel() for one in axes[2]] == ["time since the swing command [s]"] * 3
    for row in axes:
        assert len({one.get_ylim() for one in row}) == 1
    assert [one.get_title() for one in axes[0]] == [
        "Basic",
        "Method 1\nzero current: #2 #3 #9 #10",
        "Method 2\npaid out before: #9",
    ]


# Table and page.


def test_the_table_fits_a_terminal_and_shows_every_figure_beside_the_papers() -> None:
    lines = table_text(summary()).splitlines()
    assert max(len(line) for line in lines) <= 110
    assert [" ".join(line.split()) for line in lines[3:6]] == [
        "Basic 2.41 (2.4) 2.71 (2.6) 0.99 (0.99) 1.02 0.29 225 (290) none",
        "Method 1 4.39 (4.4) 3.84 (3.7) 0.60 (0.60) 0.71 0.45 176 (180) #2 #3 #9 #10",
        "Method 2 3.30 (3.3) 3.28 (3.4) 0.78 (0.78) - 0.30 157 (140) #9",
    ]


def test_the_table_stands_even_if_a_method_is_missing() -> None:
    content = summary()
    del content["methods"]["method_2"]
    del content["paper"]
    last = table_text(content).splitlines()[5]
    assert " ".join(last.split()) == "Method 2 - - - - - - none"


def test_the_page_is_one_file_with_table_and_picture(tmp_path: Path) -> None:
    picture = tmp_path / "swing.png"
    picture.write_bytes(b"\x89PNG picture")
    write_report(summary(), picture, tmp_path / "out" / "report.html")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert base64.b64encode(b"\x89PNG picture").decode() in page
    assert "<td>3.84<small>3.7</small></td>" in page
    assert "<td>#2 #3 #9 #10</td>" in page
    assert "http" not in page
    assert 'name="viewport"' in page
    assert "$" not in page
