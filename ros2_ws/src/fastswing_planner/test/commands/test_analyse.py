"""`analyse` on bags: what it says, writes and returns; and one clear line for each bad bag."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_builder import START, Builder, joint_state
from bag_of_swings import EPOCH_NS, TYPES, BagOfSwings, stamp
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from fastswing_msgs.msg import CurrentCommand, InhibitionStatus, SwingPlan, TensionCommand
from fastswing_planner.analysis.losses import recorder_losses
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.commands.analyse import main
from fastswing_planner.conversion.definitions import definition_text

ROBOT = Path(__file__).parents[4] / "src/musashi_muscle_bridge/description/musashi_left_arm.yaml"
Recorded = Callable[..., Recording]


@pytest.fixture
def bag(recorded: Recorded, tmp_path: Path) -> Path:
    made = BagOfSwings(tmp_path / "run.mcap")
    made.add_recording(recorded())
    made.add_rejections(1.0, 3)
    made.add_rejections(5.0, 10)
    return made.write()


class Answer:
    """What a run of `analyse` printed and returned."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *arguments: object) -> None:
        self.code = main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        self.out, self.err = printed.out, printed.err

    @property
    def record(self) -> Any:
        return json.loads(self.out)


Run = Callable[..., Answer]


@pytest.fixture
def analyse(capsys: pytest.CaptureFixture[str]) -> Run:
    return lambda *arguments: Answer(capsys, *arguments, "--robot", ROBOT)


def test_the_swing_is_found_in_the_bag(bag: Path, analyse: Run) -> None:
    answer = analyse(bag, "--json")
    (swing,) = answer.record["bags"][0]["swings"]
    assert answer.code == 0
    assert swing["method"] == "inhibit"
    assert swing["start"] == pytest.approx(3.979, abs=1e-6)
    assert swing["figures"]["main_joint_speed"] == pytest.approx(3.0, rel=1e-3)
    assert swing["figures"]["time"] == pytest.approx(0.875, abs=1e-6)
    assert swing["latency"]["state_to_override"]["median"] == pytest.approx(0.002, abs=1e-6)
    assert swing["latency"]["state_to_zero"]["longest"] == pytest.approx(0.01, abs=1e-6)
    assert swing["beyond_velocity_limit"] == ["#9"]


def test_what_the_nodes_counted_meanwhile_is_told(bag: Path, analyse: Run) -> None:
    record = analyse(bag, "--json").record["bags"][0]
    assert record["counters"] == {"bridge": {"rejected_not_finite": 7}}
    assert "bridge: rejected_not_finite 7" in analyse(bag).out


@pytest.mark.parametrize("value", ["²", "٣", "9" * 5000, "-1", ""])
def test_a_count_that_is_no_number_is_passed_over(value: str, bag: Path, analyse: Run) -> None:
    made = BagOfSwings(bag.with_name("count.mcap"))
    made.add("/joint_states", 0.0, JointState(name=["a"], velocity=[0.1]))
    made.add_rejections(1.0, 3)
    for message in made.messages((DiagnosticArray,)):
        message.status[0].values[0].value = value
    assert analyse(made.write(), "--json").record["bags"][0]["counters"] == {}


def test_a_plan_without_joints_is_told_and_the_others_are_used(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "plans.mcap")
    made.add("/swing_plan", 0.05, SwingPlan())
    made.add_recording(recorded())
    (record,) = analyse(made.write(), "--json").record["bags"]
    assert [swing["method"] for swing in record["swings"]] == ["inhibit"]
    assert record["lines"] == ["/swing_plan: a plan cannot be used: it names no joint"]


def test_the_table_shows_measured_beside_predicted(bag: Path, analyse: Run) -> None:
    line = next(line for line in analyse(bag).out.splitlines() if line.startswith("1  "))
    expected = "1 inhibit 3.98 3.00 (3.50) E-p 0.88 (0.75) 0.50 #9 #9 170 #1 #9 #10"
    assert " ".join(line.split()) == expected


def test_output_is_a_page_a_record_and_a_picture_for_each_swing(
    bag: Path, analyse: Run, tmp_path: Path
) -> None:
    output = tmp_path / "out"
    analyse(bag, "--output", output, "--formats", "png", "svg")
    assert sorted(path.name for path in output.iterdir()) == [
        "analysis.json",
        "report.html",
        "swing_001_inhibit.png",
        "swing_001_inhibit.svg",
    ]
    assert (output / "swing_001_inhibit.png").read_bytes().startswith(b"\x89PNG")
    assert "</svg>" in (output / "swing_001_inhibit.svg").read_text()


def test_a_violated_limit_is_one_line_and_exit_code_1(
    bag: Path, analyse: Run, tmp_path: Path
) -> None:
    limits = tmp_path / "limits.yaml"
    limits.write_text("each_swing: {time: {max: 0.5}, tension: {max: 300}}")
    answer = analyse(bag, "--check", limits)
    assert answer.code == 1
    assert [line for line in answer.out.splitlines() if line.startswith("FAIL")] == [
        "FAIL run.mcap swing 1 (inhibit, at 3.98 s): time to the end posture is 0.875 s, "
        "at most 0.5 s allowed"
    ]


def test_kept_limits_are_exit_code_0(bag: Path, analyse: Run, tmp_path: Path) -> None:
    limits = tmp_path / "limits.yaml"
    limits.write_text("swings: 1\ntopics: {joint_states: {rate: {min: 190}}}")
    answer = analyse(bag, "--check", limits)
    assert (answer.code, answer.out.splitlines()[-1]) == (0, "PASS: 2 limits kept")


def test_limits_of_each_swing_are_not_kept_by_a_bag_without_one(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "still.mcap")
    made.add_recording(recorded(until=3.0, overrides=None, status=None, commands=None))
    limits = tmp_path / "limits.yaml"
    limits.write_text("each_swing: {joints: {E-p: {max: 9}, E-q: {max: 9}}}")
    answer = analyse(made.write(), "--check", limits)
    assert answer.code == 1
    assert [line for line in answer.out.splitlines() if line.startswith("FAIL")] == [
        "FAIL no swing: the limits of each_swing could not be tried",
        "FAIL unknown joint 'E-q', the bags hold: S-p, E-p",
    ]


@pytest.mark.parametrize(
    ("name", "kind"), [("tension_command", TensionCommand), ("current_command", CurrentCommand)]
)
def test_the_rate_of_every_command_can_be_limited(
    name: str, kind: type, bag: Path, recorded: Recorded, analyse: Run
) -> None:
    made = BagOfSwings(bag.with_name("commands.mcap"))
    made.add_recording(recorded(), "/left")
    for row in range(20):
        made.add(f"/left/{name}", row / 10, kind())
    limits = bag.with_name("limits.yaml")
    limits.write_text(f"topics: {{{name}: {{rate: {{min: 11}}}}}}")
    assert "FAIL commands.mcap /left/" + name + ": rate is 10 Hz, at least 11 Hz allowed" in (
        analyse(made.write(), "--check", limits).out.splitlines()
    )


def test_a_wrong_limits_file_is_exit_code_2(bag: Path, analyse: Run, tmp_path: Path) -> None:
    limits = tmp_path / "limits.yaml"
    limits.write_text("swing: 1")
    answer = analyse(bag, "--check", limits)
    assert answer.code == 2
    assert answer.err.startswith(f"analyse: {limits}: the file: unknown key 'swing'")


def test_two_bags_are_compared(bag: Path, recorded: Recorded, analyse: Run) -> None:
    other = BagOfSwings(bag.with_name("other.mcap"))
    other.add_recording(recorded())
    answer = analyse("--compare", bag, other.write(), "--json")
    compared = {one["figure"]: one for one in answer.record["comparison"]}
    assert compared["time"]["change"] == pytest.approx(0.0, abs=1e-6)
    assert compared["time"]["verdict"] == "too few swings to tell"


def test_a_folder_is_a_group_of_its_bags(
    bag: Path, recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    group = tmp_path / "group"
    for number in range(3):
        one = BagOfSwings(group / f"{number}.mcap")
        one.add_recording(recorded())
        one.write()
    compared = analyse("--compare", bag, group, "--json").record["comparison"]
    assert {one["second"]["count"] for one in compared if one["figure"] == "time"} == {3}


def test_two_arms_in_one_bag_are_told_apart(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "two.mcap")
    made.add_recording(recorded(), "/left")
    made.add_recording(recorded(plans=()), "/right")
    swings = analyse(made.write(), "--json").record["bags"][0]["swings"]
    assert [(one["namespace"], one["method"]) for one in swings] == [
        ("/left", "inhibit"),
        ("/right", "unplanned"),
    ]


def test_joints_in_another_order_are_read_by_name(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    recording = recorded()
    made = BagOfSwings(tmp_path / "order.mcap")
    made.add_recording(recording)
    for row, message in enumerate(made.messages((JointState,))):
        if row % 2:
            message.name = message.name[::-1]
            message.position, message.velocity = message.position[::-1], message.velocity[::-1]
    (swing,) = analyse(made.write(), "--json").record["bags"][0]["swings"]
    assert swing["joints"]["E-p"]["peak_speed"] == pytest.approx(3.0, rel=1e-3)
    assert swing["joints"]["S-p"]["peak_speed"] == pytest.approx(0.15, rel=1e-3)


# Bad bags.


def noise(path: Path) -> str:
    path.write_bytes(np.random.default_rng(0).bytes(100_000))
    return f"{path} is no MCAP file"


def empty_file(path: Path) -> str:
    path.write_bytes(b"")
    return f"{path} is empty"


def no_file(path: Path) -> str:
    return f"there is no bag {path}"


def empty_bag(path: Path) -> str:
    BagWriter(path).close()
    return f"{path.name} is empty: it holds no message"


def foreign_bag(path: Path) -> str:
    made = BagOfSwings(path)
    made.add("/chatter", 0.0, String(data="hello"))
    made.write()
    return (
        f"{path.name} holds no joint states (sensor_msgs/msg/JointState); it holds: "
        "/chatter (std_msgs/msg/String)"
    )


def wrong_type(path: Path) -> str:
    made = BagOfSwings(path)
    made.add("/joint_states", 0.0, String(data="fast"))
    made.write()
    return (
        f"{path.name} holds no joint states (sensor_msgs/msg/JointState); it holds: "
        "/joint_states (std_msgs/msg/String)"
    )


def idl_bag(path: Path) -> str:
    with Builder(path) as made:
        made.topic("/joint_states", "sensor_msgs/msg/JointState", "module {};", "ros2idl")
        made.write("/joint_states", joint_state([1.0]), START)
    return (
        "/joint_states is 'cdr' with a definition in 'ros2idl'; only cdr with ros2msg can be read"
    )


@pytest.mark.parametrize(
    "make", [noise, empty_file, no_file, empty_bag, foreign_bag, wrong_type, idl_bag]
)
def test_a_bag_without_an_arm_is_one_line_and_exit_code_2(
    make: Callable[[Path], str], analyse: Run, tmp_path: Path
) -> None:
    expected = make(tmp_path / "bad.mcap")
    answer = analyse(tmp_path / "bad.mcap")
    assert (answer.code, answer.out, answer.err) == (2, "", f"analyse: {expected}\n")


def test_a_bad_bag_does_not_hide_a_good_one(bag: Path, analyse: Run, tmp_path: Path) -> None:
    noise(tmp_path / "bad.mcap")
    answer = analyse(tmp_path / "bad.mcap", bag)
    assert answer.code == 2
    assert "inhibit" in answer.out


def lines_of(answer: Answer) -> Any:
    (bag,) = answer.record["bags"]
    return bag["lines"]


def test_a_bag_without_a_swing_says_how_fast_the_arm_was(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "still.mcap")
    made.add_recording(recorded(until=3.0, overrides=None, status=None, commands=None))
    answer = analyse(made.write(), "--json")
    assert answer.code == 0
    assert lines_of(answer) == [
        "no swing: the fastest joint, E-p, reached 0.80 rad/s, a swing exceeds 1 rad/s "
        "(--swing-speed)"
    ]


def test_a_bag_without_velocities_says_so(analyse: Run, tmp_path: Path) -> None:
    made = BagOfSwings(tmp_path / "positions.mcap")
    for row in range(20):
        made.add("/joint_states", row / 100, JointState(name=["a"], position=[0.1 * row]))
    assert lines_of(analyse(made.write(), "--json")) == [
        "no swing: the joint states hold no velocity"
    ]


def test_what_is_unknown_without_a_plan_is_null(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "unplanned.mcap")
    made.add_recording(recorded(plans=()))
    (bag,) = analyse(made.write(), "--json", "--output", tmp_path / "out").record["bags"]
    assert bag["swings"][0]["muscles"]["#9"]["elongation"] is None
    assert "NaN" not in (tmp_path / "out" / "analysis.json").read_text()


def test_a_clock_that_jumps_is_told_and_what_is_whole_is_still_measured(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "jump.mcap")
    made.add_recording(recorded())
    for message in made.messages((JointState,)):
        if message.header.stamp.sec == EPOCH_NS // 10**9:
            message.header.stamp.sec += 100
    answer = analyse(made.write(), "--json")
    assert len(answer.record["bags"][0]["swings"]) == 1
    assert lines_of(answer) == [
        "the clock jumped back for 100.00 s at 100.99 s; no swing is read across it"
    ]


@pytest.mark.parametrize(
    ("lead", "line"),
    [
        (5.0, "the recorder's clock is 5.00 s ahead of the stamps"),
        (-5.0, "the recorder's clock is 5.00 s behind the stamps"),
    ],
)
def test_a_recorder_with_another_clock_is_told_and_spoils_no_swing(
    lead: float, line: str, recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "clocks.mcap")
    made.add_recording(recorded())
    made.delay_recording(lead)
    answer = analyse(made.write(), "--json")
    (swing,) = answer.record["bags"][0]["swings"]
    assert swing["figures"]["rejected"] == 2
    assert swing["figures"]["predicted_time"] == 0.75
    assert swing["figures"]["state_to_override"] is None
    (told,) = lines_of(answer)
    assert told == f"/joint_states: {line}; latencies of overrides mean nothing"


def test_the_clocks_of_a_recorder_that_is_slow_by_less_than_half_a_second_agree(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "slow.mcap")
    made.add_recording(recorded())
    made.delay_recording(0.4)
    assert lines_of(analyse(made.write(), "--json")) == []


def test_a_status_counts_when_its_joint_state_was_measured(
    recorded: Recorded, analyse: Run, tmp_path: Path
) -> None:
    made = BagOfSwings(tmp_path / "late.mcap")
    made.add_recording(recorded(status=None))
    for measured, recorded_at, rejected in ((4.0, 4.0, 3), (9.0, 4.3, 7)):
        status = InhibitionStatus(header=Header(stamp=stamp(measured)), armed=True)
        status.rejected = rejected
        made.add("/inhibition_status", recorded_at, status)
    (swing,) = analyse(made.write(), "--json").record["bags"][0]["swings"]
    assert swing["figures"]["rejected"] == 3


def test_what_the_recorder_lost_is_told(bag: Path, analyse: Run, tmp_path: Path) -> None:
    path = tmp_path / "lossy.mcap"
    notes = {"lost": json.dumps({"/joint_states": 0, "/muscle_state": 12})}
    writer = BagWriter(path, notes=lambda: notes)
    kind = TYPES[JointState]
    writer.add_topic(BagTopic("/joint_states", kind, definition_text(kind)))
    message = JointState(header=Header(stamp=stamp(0.0)), name=["a"], velocity=[0.1])
    writer.write("/joint_states", bytes(serialize_message(message)), EPOCH_NS, EPOCH_NS)
    writer.close()
    assert "the recorder lost 12 messages of /muscle_state" in lines_of(analyse(path, "--json"))


@pytest.mark.parametrize("lost", ["{", "[1]", '{"/a": "many"}'])
def test_notes_of_a_recorder_that_make_no_sense_are_a_line(lost: str) -> None:
    records = [(Path("a.mcap"), "fastswing_recorder", {"lost": lost})]
    assert recorder_losses(records) == [
        "a.mcap: what the recorder says of its losses cannot be read"
    ]


def test_a_reader_that_has_seen_enough_is_no_error(bag: Path) -> None:
    program = (
        "from fastswing_planner.commands.analyse import main\n"
        f"raise SystemExit(main([{str(bag)!r}]))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    complaint = process.stderr.read()
    process.stderr.close()
    assert (process.wait(timeout=60), complaint) == (0, "")


def test_an_output_that_cannot_be_written_is_a_line(
    bag: Path, analyse: Run, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    answer = analyse(bag, "--output", tmp_path / "file" / "folder")
    assert answer.code == 2
    assert answer.err.startswith(f"analyse: cannot write {tmp_path / 'file' / 'folder'}: ")


def test_a_truncated_bag_is_read_as_far_as_it_goes(bag: Path, analyse: Run) -> None:
    whole = bag.read_bytes()
    cut = bag.with_name("cut.mcap")
    cut.write_bytes(whole[: len(whole) * 9 // 10])
    answer = analyse(cut, "--json")
    assert answer.code == 0
    assert any("was not finished" in line for line in lines_of(answer))


@pytest.mark.parametrize("option", ["--swing-speed", "--rest-time", "--tolerance"])
def test_a_number_that_makes_no_sense_is_refused(bag: Path, analyse: Run, option: str) -> None:
    answer = analyse(bag, option, "-1")
    assert answer.code == 2
    assert "is -1" in answer.err


def test_without_ros_only_the_default_robot_is_missing(bag: Path) -> None:
    program = (
        "import sys\n"
        "for name in ('rclpy', 'ament_index_python', 'fastswing_msgs', 'sensor_msgs'):\n"
        "    sys.modules[name] = None\n"
        "from fastswing_planner.commands.analyse import main\n"
        f"raise SystemExit(main([{str(bag)!r}]))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0
    assert "speed limits are not known: package://" in done.stderr
    assert "inhibit" in done.stdout
