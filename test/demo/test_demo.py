"""`make demo` as its user sees it: the figures, the files, and nothing left behind."""

import json
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from matplotlib.image import imread
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.reading import read_recordings
from fastswing_planner.bags import open_bag
from fastswing_planner.execution.figures import SwingFigures
from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop

ROOT = Path(__file__).parents[2]
DEMO = [sys.executable, "-u", str(ROOT / "demo/run_demo.py"), "--output"]
METHODS = ["basic", "method_1", "method_2"]
MASKED = {"basic": [], "method_1": ["#2", "#3", "#9", "#10"], "method_2": ["#9"]}
PREDICTED_SPEED = {"basic": 2.4, "method_2": 3.3, "method_1": 4.4}
MEASURED_SPEED = {"basic": 2.6, "method_2": 3.4, "method_1": 3.7}
PLANNED = {"basic": Method.BASIC, "method_1": Method.INHIBIT, "method_2": Method.ELONGATE}
ELBOW = 3
FIGURES = {
    "peak_elbow_pitch_velocity_rad_s",
    "time_cost_s",
    "max_muscle_velocity_m_s",
    "max_tension_n",
}
SPEED_LIMIT = 0.30
DEMO_SEC = 600.0
MARK = "FASTSWING_TEST_MARK"
EVERY_SWING = {
    "/joint_states",
    "/muscle_state",
    "/length_command",
    "/swing_plan",
    "/diagnostics",
}
"""Topics with messages in the bag of each method; Method 1's has two more."""
ONLY_METHOD_1 = {"/current_override", "/inhibition_status"}


class Demo:
    """A demo of this test's own, known by a mark in the environment of all that it starts."""

    def __init__(self, output: Path) -> None:
        self.output = output
        self._mark = uuid.uuid4().hex
        self.process = subprocess.Popen(
            [*DEMO, str(output)],
            env={**os.environ, MARK: self._mark},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def wait_for_line(self, text: str) -> None:
        assert self.process.stdout is not None
        printed = []
        for line in self.process.stdout:
            printed.append(line)
            if text in line:
                return
        pytest.fail(f"the demo never printed '{text}':\n{''.join(printed)}")

    def press_ctrl_c(self) -> None:
        """Interrupt the demo's process group, as a terminal does."""
        os.killpg(self.process.pid, signal.SIGINT)

    def left_behind(self) -> dict[int, str]:
        """Return the command lines of the processes that carry the mark."""
        found = {}
        for folder in Path("/proc").iterdir():
            if not folder.name.isdigit():
                continue
            try:
                marked = f"{MARK}={self._mark}".encode() in (folder / "environ").read_bytes()
                command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:  # ended meanwhile, or not ours
                continue
            if marked and command:
                found[int(folder.name)] = command
        return found

    def close(self) -> None:
        """End what is left."""
        for pid in self.left_behind():
            os.kill(pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()


@dataclass(frozen=True)
class Finished:
    """A demo that ended by itself."""

    output: Path
    code: int
    printed: str
    left_behind: dict[int, str]
    summary: dict[str, Any]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Finished]:
    output = tmp_path_factory.mktemp("demo") / "out"
    demo = Demo(output)
    try:
        printed, _ = demo.process.communicate(timeout=DEMO_SEC)
        assert (output / "summary.json").exists(), printed
        yield Finished(
            output,
            demo.process.returncode,
            printed,
            demo.left_behind(),
            json.loads((output / "summary.json").read_text()),
        )
    finally:
        demo.close()


def figures(finished: Finished, method: str, kind: str) -> dict[str, float]:
    return dict(finished.summary["methods"][method][kind])


def messages(bag: Path, topic: str) -> list[Any]:
    with bag.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [decoded for *_, decoded in reader.iter_decoded_messages(topics=[topic])]


def test_the_demo_ends_with_0(finished: Finished) -> None:
    assert finished.code == 0, finished.printed


def test_the_demo_leaves_no_process(finished: Finished) -> None:
    assert finished.left_behind == {}


def test_the_demo_prints_a_row_for_each_method(finished: Finished) -> None:
    assert all(name in finished.printed for name in ("Basic", "Method 1", "Method 2"))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", ["predicted", "measured"])
def test_the_summary_has_the_four_figures(finished: Finished, method: str, kind: str) -> None:
    assert set(figures(finished, method, kind)) == FIGURES


@pytest.mark.parametrize("method", METHODS)
def test_the_summary_names_the_masked_muscles(finished: Finished, method: str) -> None:
    assert finished.summary["methods"][method]["masked_muscles"] == MASKED[method]


@pytest.mark.parametrize("method", METHODS)
def test_the_predicted_speed_is_the_papers(finished: Finished, method: str) -> None:
    speed = figures(finished, method, "predicted")["peak_elbow_pitch_velocity_rad_s"]
    assert speed == pytest.approx(PREDICTED_SPEED[method], rel=0.10)


@pytest.mark.parametrize("method", METHODS)
def test_the_measured_speed_is_near_the_papers_robot(finished: Finished, method: str) -> None:
    speed = figures(finished, method, "measured")["peak_elbow_pitch_velocity_rad_s"]
    assert speed == pytest.approx(MEASURED_SPEED[method], rel=0.08)


def headless(method: str, delay: float = 0.004) -> SwingFigures:
    """Swing without ROS, at the rates of the nodes."""
    robot = load_robot(MUSASHI)
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    start, end = robot.postures["start"], robot.postures["end"]
    loop = ClosedLoop(robot, planner, rate=500.0, executor_rate=100.0, inhibition_delay=delay)
    return loop.run(planner.plan(SwingRequest(start, end, PLANNED[method])), ExecutionSettings())


@pytest.mark.parametrize("method", METHODS)
def test_the_loop_without_ros_reaches_the_same_elbow_speed(finished: Finished, method: str) -> None:
    speed = figures(finished, method, "measured")["peak_elbow_pitch_velocity_rad_s"]
    assert headless(method).peak_joint_velocity[ELBOW] == pytest.approx(speed, rel=0.03)


@pytest.mark.parametrize("method", ["basic", "method_2"])
def test_the_loop_without_ros_reaches_the_same_tension(finished: Finished, method: str) -> None:
    tension = figures(finished, method, "measured")["max_tension_n"]
    assert headless(method).peak_tension.max() == pytest.approx(tension, rel=0.03)


def test_method_1s_tension_is_that_of_the_loop_with_the_delays_of_a_busy_machine(
    finished: Finished,
) -> None:
    # It is #9's when it is driven again at the end: the later, the slower the arm is by then.
    tension = figures(finished, "method_1", "measured")["max_tension_n"]
    late, early = (headless("method_1", delay).peak_tension.max() for delay in (0.02, 0.0))
    assert 0.97 * late <= tension <= 1.03 * early


def test_method_2_is_faster_than_basic_and_method_1_faster_still(finished: Finished) -> None:
    speeds = [
        figures(finished, method, "measured")["peak_elbow_pitch_velocity_rad_s"]
        for method in ("basic", "method_2", "method_1")
    ]
    assert speeds == sorted(set(speeds))


def test_method_1_back_drives_a_masked_muscle_beyond_the_limit(finished: Finished) -> None:
    states = messages(finished.output / "method_1.mcap", "/muscle_state")
    masked = [states[0].name.index(name) for name in MASKED["method_1"]]
    assert max(abs(state.velocity[index]) for state in states for index in masked) > SPEED_LIMIT


@pytest.mark.parametrize("method", ["basic", "method_2"])
def test_no_muscle_exceeds_the_limit_in(finished: Finished, method: str) -> None:
    fastest = figures(finished, method, "measured")["max_muscle_velocity_m_s"]
    assert fastest <= 1.05 * SPEED_LIMIT


@pytest.mark.parametrize("method", METHODS)
def test_every_topic_of_the_swing_is_in_its_bag(finished: Finished, method: str) -> None:
    expected = EVERY_SWING | (ONLY_METHOD_1 if method == "method_1" else set())
    bag = finished.output / finished.summary["methods"][method]["bag"]
    assert {topic for topic in EVERY_SWING | ONLY_METHOD_1 if messages(bag, topic)} == expected


@pytest.mark.parametrize("method", METHODS)
def test_analyse_finds_the_swing_in_the_bag_with_the_figures_of_the_summary(
    finished: Finished, method: str
) -> None:
    bag = finished.output / finished.summary["methods"][method]["bag"]
    (recording,) = read_recordings(bag.name, open_bag(bag), FindingSettings())
    (swing,) = measure_swings(recording)
    measured = figures(finished, method, "measured")
    predicted = figures(finished, method, "predicted")
    assert swing.method == PLANNED[method].name.lower()
    assert swing.main_joint.name == "E-p"
    assert swing.fastest_muscle is not None
    assert swing.tightest_muscle is not None
    assert swing.main_joint.peak_speed == pytest.approx(
        measured["peak_elbow_pitch_velocity_rad_s"], rel=0.02
    )
    # The executor's clock and the stamps of command and states differ by their ways.
    assert swing.arrival == pytest.approx(measured["time_cost_s"], abs=0.03)
    assert swing.fastest_muscle.peak_speed == pytest.approx(
        measured["max_muscle_velocity_m_s"], rel=0.02
    )
    assert swing.tightest_muscle.peak_tension == pytest.approx(measured["max_tension_n"], rel=0.02)
    assert swing.predicted_time == pytest.approx(predicted["time_cost_s"], abs=1e-3)
    assert swing.main_joint.predicted_peak_speed == pytest.approx(
        predicted["peak_elbow_pitch_velocity_rad_s"], abs=1e-3
    )


def test_the_picture_is_readable(finished: Finished) -> None:
    height, width = imread(finished.output / "swing.png").shape[:2]
    assert min(height, width) > 400


def test_the_page_shows_the_picture_and_the_table(finished: Finished) -> None:
    page = (finished.output / "report.html").read_text()
    assert "<img" in page
    assert "<table" in page


@pytest.fixture
def interrupted(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Demo]:
    """Interrupt a demo when it prints a text, and wait for its end."""
    demo = Demo(tmp_path / "out")
    try:
        demo.wait_for_line(request.param)
        demo.press_ctrl_c()
        demo.process.communicate(timeout=DEMO_SEC)
        yield demo
    finally:
        demo.close()


@pytest.mark.parametrize("interrupted", ["waiting for", "basic: raise"], indirect=True)
def test_an_interrupted_demo_ends_with_130_and_leaves_no_process(interrupted: Demo) -> None:
    assert (interrupted.process.returncode, interrupted.left_behind()) == (130, {})
