"""The whole loop, from an encoder of the emulated arm to zero current on its wire: see QUESTION.

scripts/ros_env python test/bench/whole_loop.py [SCALE [FOLDER OF PLOTS]]
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "demo"))

import numpy as np
from board_times import BoardTimes, read_board_log
from builtin_interfaces.msg import Duration
from listening import Listener
from machine import TUNED
from numpy.typing import NDArray
from pace_baseline import PaceBaseline
from processes import Process, free_domain, free_udp_port, isolated_environment, stop_all
from rclpy.task import Future
from rounds import Row
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import ErrorCode, LengthCommand
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.bags import Bag, open_bag
from fastswing_planner.execution.posture_path import encoder_lengths
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.buses.protocol import COMMAND_ROW

QUESTION = (
    "How long does it take from a change of the encoders to zero current on the boards, and where "
    "does the time go, with all nodes on two cores, while a bag is recorded and the planner "
    "answers?"
)

RATE_HZ = 1000.0
RUN_SEC = 50.0
RIGHTS: Mapping[str, Mapping[str, object]] = {
    "as started": {},
    "cores sleep": {"prevent_core_sleep": False},
    "tuned": TUNED,
}
CORES = 2
STAGES = (
    "boards answer",
    "to control process",
    "bridge: joint_states",
    "inhibitor: current_override",
    "bridge, period: to the wire",
    "boards obey",
)
_ELBOW = {"flexed": -0.9, "bent": -0.4, "goal": -1.9}  # [rad]
_TURN_SEC = 0.4
_PLAN_PAUSE_SEC = 0.1
_TENSION = 15.0  # [N] at rest
_SETTLE_SEC = 1.5
_MORE_REQUESTS = 4
_PERCENTILES = (50, 99)


@dataclass(frozen=True)
class Events:
    """Decisions to let a muscle go, as they went through the loop.

    stages   [s] shape (k, 6): how long each of STAGES took
    lost     decisions that were never obeyed
    missing  overrides that the recorder lost
    plans    answers of the planner meanwhile
    """

    stages: NDArray[np.float64]
    lost: int
    missing: int
    plans: int


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Keep this process and those it starts on some of the cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(before)[:count]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


class TaskCode:
    """Lets the arm flex and stretch its elbow, and asks the planner all the time."""

    def __init__(self, listener: Listener, robot: Robot) -> None:
        self.answers = 0
        self._listener = listener
        self._robot = robot
        node = listener.node
        self._command = node.create_publisher(LengthCommand, "length_command", 10)
        self._plan = node.create_client(PlanSwing, "plan_swing")
        self._pending: Future | None = None
        self._asked = 0.0
        self._turn = 0
        self._lengths = [self._wire(_ELBOW[name]) for name in ("bent", "flexed")]
        listener.until("the planner", self._plan.service_is_ready)
        listener.until("the bridge", lambda: self._command.get_subscription_count() > 0)
        self._timers = [
            node.create_timer(_TURN_SEC, self._move),
            node.create_timer(_PLAN_PAUSE_SEC, self._ask),
        ]

    def posture(self, elbow: float) -> NDArray[np.float64]:
        """Return the joint angles [rad], shape (n,), with the elbow at an angle [rad]."""
        angles = self._robot.postures["home"].copy()
        angles[self._robot.model.joint_names.index("E-p")] = elbow
        return angles

    def _wire(self, elbow: float) -> list[float]:
        robot = self._robot
        tension = np.full(len(robot.model.muscle_names), _TENSION)
        lengths = encoder_lengths(robot.model, robot.wire_stiffness, self.posture(elbow), tension)
        return [float(length) for length in lengths]

    def _stamp(self) -> Any:
        return self._listener.node.get_clock().now().to_msg()

    def _move(self) -> None:
        self._turn = 1 - self._turn
        self._command.publish(
            LengthCommand(
                header=Header(stamp=self._stamp()),
                name=self._robot.model.muscle_names,
                length=self._lengths[self._turn],
            )
        )

    def _ask(self) -> None:
        if self._pending is not None:
            if not self._pending.done():
                return
            self.answers += 1
        request = PlanSwing.Request(
            start_position=self._robot.postures["start"].tolist(),
            end_position=self._robot.postures["end"].tolist(),
        )
        self._pending = self._plan.call_async(request)

    def arm(self, seconds: float) -> None:
        """Arm the inhibitor toward a goal that the arm does not come near to."""

        def ask() -> ArmInhibitor.Response:
            return self._listener.call(
                ArmInhibitor,
                "arm_inhibitor",
                ArmInhibitor.Request(
                    stamp=self._stamp(),
                    goal_position=self.posture(_ELBOW["goal"]).tolist(),
                    time_limit=Duration(sec=int(seconds) + 1),
                ),
            )

        answer = in_time(ask)
        if answer.error_code:
            raise RuntimeError(f"the inhibitor is not armed: {answer.error_string}")


def in_time(ask: Callable[[], ArmInhibitor.Response]) -> ArmInhibitor.Response:
    """Ask until a request comes in time, at most so often; returns the last answer.

    On a busy machine a request can be too old when it arrives. Each other answer counts.
    """
    answer = ask()
    for _ in range(_MORE_REQUESTS):
        if answer.error_code != ErrorCode.STALE_REQUEST:
            break
        answer = ask()
    return answer


def _start(
    folder: Path, environment: Mapping[str, str], rights: Mapping[str, object]
) -> list[Process]:
    bus = {"bus_url": f"udp://127.0.0.1:{free_udp_port()}"}
    inhibitor: dict[str, object] = {
        # The elbow goes to and fro for the whole run: neither turning back nor a stall of this
        # machine may end it.
        "reversal_speed": 10.0,
        "state_timeout": 1.0,
        "lease": 0.2,
        "max_time_limit": 60.0,
        **rights,
    }
    nodes: tuple[tuple[str, str, dict[str, object]], ...] = (
        ("musashi_muscle_bridge", "mock_driver", {**bus, "board_log": folder / "boards.tsv"}),
        ("musashi_muscle_bridge", "bridge", {**bus, "control_rate": RATE_HZ, **rights}),
        ("fastswing_planner", "planner", {}),
        ("fastswing_inhibitor", "inhibitor", inhibitor),
        ("fastswing_planner", "record", {"output": folder / "bag.mcap"}),
    )
    return [
        Process(package, name, parameters, environment, folder / f"{name}.log")
        for package, name, parameters in nodes
    ]


def measure(
    folder: Path, seconds: float, rights: Mapping[str, object]
) -> tuple[Events, NDArray[np.float64]]:
    """Return what happened in some seconds, and round trips of the baseline in the same [s].

    rights  parameters of bridge and inhibitor
    """
    folder.mkdir()
    domain = free_domain()
    processes = _start(folder, isolated_environment(domain), rights)
    listener = Listener(domain)
    baseline: PaceBaseline | None = None
    try:
        heard = listener.listen(JointState, "joint_states")
        listener.until("joint states", lambda: len(heard) > 0)
        robot = load_robot(MUSASHI)
        task = TaskCode(listener, robot)
        listener.spin(_SETTLE_SEC)
        task.arm(seconds)
        frame = len(robot.model.muscle_names) * COMMAND_ROW.itemsize
        baseline = PaceBaseline(frame, 1.0 / RATE_HZ, seconds)
        begin, answers = time.monotonic(), task.answers
        listener.spin(seconds)
        end, answers = time.monotonic(), task.answers - answers
        round_trip = baseline.result().round_trip
    finally:
        if baseline is not None:
            baseline.stop()
        stop_all(processes)
        listener.close()
    boards = read_board_log(folder / "boards.tsv")
    traced = _trace(folder / "bag.mcap", boards, listener, robot, (begin, end))
    return Events(*traced, answers), round_trip


def _decisions(bag: Bag, robot: Robot) -> Iterator[tuple[int, int, int]]:
    """Yield the decisions that let another muscle go: stamp [ns], publication [ns], which one."""
    overrides = bag.columns("/current_override", time="header")
    muscles = {name: index for index, name in enumerate(robot.model.muscle_names)}
    # Of a decision that was not recorded nobody knows when it was made.
    complete = np.diff(overrides.sequence.astype(int), prepend=-1) == 1
    before: set[str] = set()
    for stamp, decided, names, follows in zip(
        overrides.time_ns.tolist(),
        overrides.publish_time_ns.tolist(),
        overrides["name"],
        complete.tolist(),
        strict=True,
    ):
        newly, before = set(names) - before, set(names)
        if newly and follows:
            yield stamp, decided, muscles[min(newly)]


def _trace(
    bag_path: Path,
    boards: BoardTimes,
    listener: Listener,
    robot: Robot,
    window: tuple[float, float],
) -> tuple[NDArray[np.float64], int, int]:
    """Follow each decision that lets another muscle go from the encoders to the boards."""
    bag = open_bag(bag_path)
    joints = bag.columns("/joint_states", time="header", fields=["header.stamp.sec"])
    published = dict(zip(joints.time_ns.tolist(), joints.publish_time_ns.tolist(), strict=True))
    found: list[list[float]] = []
    lost = 0
    for stamp, decided_ns, muscle in _decisions(bag, robot):
        decided = listener.monotonic(decided_ns)
        if stamp not in published or not window[0] < decided < window[1]:
            continue
        answer = boards.answer_before(listener.monotonic(stamp))
        at_work = int(np.searchsorted(boards.arrived, decided)) - 1
        if boards.off[at_work, muscle]:
            continue  # it was off still, by an earlier decision
        command = boards.first_off(muscle, decided)
        if command is None:
            lost += 1
            continue
        times = [
            boards.measured[answer],
            boards.sent[answer],
            listener.monotonic(stamp),
            listener.monotonic(published[stamp]),
            decided,
            boards.arrived[command],
            # The boards measure right after they took a command.
            boards.measured[command],
        ]
        found.append(np.diff(times).tolist())
    missing = bag.lost.get("/current_override", 0)
    return np.array(found).reshape(-1, len(STAGES)), lost, missing


def _plot(found: Mapping[str, NDArray[np.float64]], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        len(found), 2, figsize=(11.0, 3.6 * len(found)), width_ratios=(2, 1), sharex="col"
    )
    for (bars, spread), (title, stages) in zip(axes, found.items(), strict=True):
        _draw_waterfall(bars, stages)
        bars.set_title(title)
        total = np.sort(stages.sum(axis=1)) * 1e3
        spread.plot(total, (np.arange(total.size) + 1) / total.size)
        spread.set_ylabel("share of decisions")
        spread.grid(alpha=0.3)
    axes[-1][0].set_xlabel("time since the encoders changed [ms]; medians, bars: 10 to 90 %")
    longest = max(float(np.percentile(stages.sum(axis=1), 99)) for stages in found.values())
    axes[-1][1].set_xlim(0.0, longest * 1e3)
    axes[-1][1].set_xlabel("encoder to zero current [ms]")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def _draw_waterfall(bars: Any, stages: NDArray[np.float64]) -> None:
    begin = 0.0
    for row in range(len(STAGES)):
        low, median, high = np.percentile(stages[:, row] * 1e3, (10, 50, 90))
        bars.barh(row, median, left=begin)
        bars.errorbar(
            begin + median, row, xerr=[[median - low], [high - median]], color="black", capsize=3
        )
        bars.annotate(
            f"{median * 1e3:.0f} us", (begin + high, row), (6, -4), textcoords="offset points"
        )
        begin += median
    bars.set_yticks(range(len(STAGES)), STAGES)
    bars.invert_yaxis()
    bars.margins(x=0.2)
    bars.set_xlim(left=0.0)


def _row(name: str, seconds: NDArray[np.float64], floor: float, note: str = "") -> Row:
    median, p99 = np.percentile(seconds * 1e6, _PERCENTILES).tolist()
    return Row(
        name,
        median,
        p99,
        float(seconds.max() * 1e6),
        baseline="UDP echo in C" if floor else "",
        ratio=median / (floor * 1e6) if floor else None,
        note=note,
    )


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; `scale` 1 takes about three minutes. Plot: performance_whole_loop.png."""
    seconds = max(RUN_SEC * scale, 3.0)
    with tempfile.TemporaryDirectory() as folder, on_cores(CORES):
        found = {
            title: measure(Path(folder) / title, seconds, rights)
            for title, rights in RIGHTS.items()
        }
    drawn = {title: events.stages for title, (events, _) in found.items() if len(events.stages)}
    if plots is not None and len(drawn) == len(found):
        _plot(drawn, plots / "performance_whole_loop.png")
    return [row for title, one in found.items() for row in _rows(title, *one)]


def _rows(title: str, events: Events, round_trip: NDArray[np.float64]) -> list[Row]:
    stages, name = events.stages, f"{title}: encoder to zero current"
    note = (
        f"{len(stages)} decisions, {events.lost} never obeyed, {events.missing} overrides not "
        f"recorded; {events.plans} plans meanwhile"
    )
    if not len(stages):
        return [Row(name, float("nan"), note=note)]
    total = _row(name, stages.sum(axis=1), float(np.median(round_trip)), note)
    alone = (_row(f"{title}:   {one}", stages[:, n], 0.0) for n, one in enumerate(STAGES))
    return [total, *alone]
