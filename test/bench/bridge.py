"""The bridge between boards and topics, timed at the boards: see QUESTION.

scripts/ros_env python test/bench/bridge.py [SCALE]
"""

import os
import random
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "demo"))

import numpy as np
from board_times import BoardTimes, missed_periods, read_board_log
from builtin_interfaces.msg import Duration
from limbed_arm import write_limbed_arm
from listening import Listener
from machine import TUNED
from numpy.typing import NDArray
from pace_baseline import Pace, PaceBaseline
from processes import Process, free_domain, free_udp_port, isolated_environment, stop_all
from rclpy.serialization import deserialize_message
from rounds import Row

from fastswing_msgs.msg import CurrentOverride, MuscleState
from fastswing_planner.conversion.message_template import MessageTemplate
from fastswing_planner.conversion.number_places import STAMP
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.buses.protocol import COMMAND_ROW

QUESTION = (
    "How soon is a reply of the boards published, how soon is an override on the wire, and how "
    "regular are the frames, at 1 kHz?"
)

RATE_HZ = 1000.0
PERIOD = 1.0 / RATE_HZ
ROUNDS = 3
ROUND_SEC = 15.0
OBEY_BOUND = PERIOD + 0.3e-3
JITTER_BOUND = 0.5e-3
_SWITCH_SEC = 0.025
_LEASE_SEC = 0.2
_SETTLE_SEC = 1.0
_STALL = 0.5
"""Periods by which a C program has to be late for its stall to explain a missed period."""
_WATCH_PERIOD = _STALL * PERIOD
"""So a stall of a period is seen for certain: a program that sleeps longer may not notice it."""


Window = tuple[float, float]
"""From when to when [s]."""


@dataclass
class Measured:
    """What was measured in some rounds; times [s].

    published     from a reply's leaving the boards to its muscle_state
    obeyed        from an override's publication to its frame's arrival at the boards
    jitter        distance of each period from the nominal one
    baseline      of each round
    missed        periods without a frame
    unexcused     those of them that no stall explains which a watch saw
    above_all     the kernel let the watches run before the bridge
    rival_missed  periods that the baseline missed meanwhile
    periods       how many there were
    """

    published: list[NDArray[np.float64]] = field(default_factory=list)
    obeyed: list[NDArray[np.float64]] = field(default_factory=list)
    jitter: list[NDArray[np.float64]] = field(default_factory=list)
    baseline: list[Pace] = field(default_factory=list)
    missed: list[int] = field(default_factory=list)
    unexcused: list[int] = field(default_factory=list)
    above_all: bool = True
    rival_missed: int = 0
    periods: int = 0


class Switching:
    """Publishes overrides of one muscle and releases it, in turns; serialised, as the inhibitor.

    published  when it began to publish each override [s]
    """

    def __init__(self, listener: Listener, name: str) -> None:
        self.published: list[float] = []
        self._clock = listener.node.get_clock()
        self._publisher = listener.node.create_publisher(CurrentOverride, "current_override", 1)
        lease = Duration(nanosec=round(_LEASE_SEC * 1e9))
        self._messages = [
            MessageTemplate(CurrentOverride(name=names, lease=lease), STAMP)
            for names in ([], [name])
        ]
        self._random = random.Random(0)
        self._on = False
        listener.until("the bridge to listen", lambda: self._publisher.get_subscription_count() > 0)
        self._timer = listener.node.create_timer(_SWITCH_SEC, self._switch)

    def _switch(self) -> None:
        # Without this all overrides would come at the same place in the bridge's period.
        time.sleep(self._random.uniform(0.0, PERIOD))
        self._on = not self._on
        stamp = self._clock.now().to_msg()
        message = self._messages[self._on].filled(stamp.sec, stamp.nanosec)
        if self._on:
            self.published.append(time.monotonic())
        self._publisher.publish(message)


def measure(
    measured: Measured, robot: str, folder: Path, seconds: float, **options: object
) -> None:
    """Add a round: boards, bridge and baseline for some seconds, then with watches as long.

    Watches come before all others and often, so all else is measured without them.
    """
    description = load_robot(robot)
    names = description.model.muscle_names
    domain = free_domain()
    log = folder / "boards.tsv"
    processes = _start(robot, folder, isolated_environment(domain), log, options)
    listener = Listener(domain)
    priority = int(str(options.get("realtime_priority", 0)))
    programs: list[PaceBaseline] = []
    try:
        heard = listener.listen(MuscleState, "muscle_state")
        listener.until("muscle states", lambda: len(heard) > 0)
        switching = Switching(listener, names[0])
        listener.spin(_SETTLE_SEC)
        frame = len(names) * COMMAND_ROW.itemsize
        programs.append(PaceBaseline(frame, PERIOD, seconds, priority=priority))
        timed = _window(listener, seconds)
        pace = programs[0].result()
        programs.append(PaceBaseline(frame, PERIOD, seconds, priority=priority))
        # On each core, as the bridge may have met a stall on any, and always before the bridge,
        # which must not explain its own lateness.
        for core in sorted(os.sched_getaffinity(0)):
            programs.append(PaceBaseline(0, _WATCH_PERIOD, seconds, core, priority + 1))
        watched = _window(listener, seconds)
        rival, *watches = [program.result() for program in programs[1:]]
    finally:
        for program in programs:
            program.stop()
        stop_all(processes)
        listener.close()
    boards = read_board_log(log)
    log.unlink()
    measured.baseline.append(pace)
    measured.published.append(_published(boards, heard, listener, timed))
    measured.obeyed.append(_obeyed(boards, switching.published, timed))
    measured.jitter.append(np.abs(np.diff(_within(boards.arrived, timed)) - PERIOD))
    measured.above_all = measured.above_all and all(one.has_priority for one in programs[2:])
    measured.rival_missed += int(np.sum(rival.lateness > PERIOD))
    _add_missed(measured, _within(boards.arrived, watched), watches)


def _start(
    robot: str,
    folder: Path,
    environment: Mapping[str, str],
    log: Path,
    options: Mapping[str, object],
) -> list[Process]:
    parameters = {
        "robot_description": robot,
        "bus_url": f"udp://127.0.0.1:{free_udp_port()}",
    }
    nodes: tuple[tuple[str, dict[str, object]], ...] = (
        ("mock_driver", {"board_log": log}),
        ("bridge", {"control_rate": RATE_HZ, **options}),
    )
    return [
        Process(
            "musashi_muscle_bridge",
            name,
            {**parameters, **own},
            environment,
            folder / f"{name}.log",
        )
        for name, own in nodes
    ]


def _window(listener: Listener, seconds: float) -> Window:
    begin = time.monotonic()
    listener.spin(seconds)
    return begin, time.monotonic()


def _within(times: NDArray[np.float64], window: Window) -> NDArray[np.float64]:
    begin, end = window
    return times[(times > begin) & (times < end)]


def _published(
    boards: BoardTimes,
    heard: Sequence[tuple[float, bytes]],
    listener: Listener,
    window: Window,
) -> NDArray[np.float64]:
    found = []
    for published, data in heard:
        if window[0] < published < window[1]:
            stamp = deserialize_message(data, MuscleState).header.stamp
            received = listener.monotonic(stamp.sec * 1_000_000_000 + stamp.nanosec)
            answer = boards.answer_before(received)
            if answer >= 0:
                found.append(published - boards.sent[answer])
    return np.array(found)


def _obeyed(boards: BoardTimes, published: Sequence[float], window: Window) -> NDArray[np.float64]:
    found = []
    for time_published in published:
        command = boards.first_off(0, time_published)
        if window[0] < time_published < window[1] and command is not None:
            found.append(boards.arrived[command] - time_published)
    return np.array(found)


def _add_missed(measured: Measured, arrived: NDArray[np.float64], watches: Sequence[Pace]) -> None:
    missed = missed_periods(arrived, PERIOD)
    limit = _STALL * PERIOD
    measured.periods += arrived.size
    measured.missed.append(sum(count for _, _, count in missed))
    measured.unexcused.append(
        sum(
            count
            for first, last, count in missed
            if not any(watch.stalled(first, last, limit) for watch in watches)
        )
    )


def _row(
    name: str,
    rounds: Sequence[NDArray[np.float64]],
    baseline: Sequence[NDArray[np.float64]],
    bound: str = "",
    met: bool | None = None,
    note: str = "",
) -> Row:
    def ratios(share: float) -> list[float]:
        return [
            float(np.percentile(one, share) / np.percentile(floor, share))
            for one, floor in zip(rounds, baseline, strict=True)
        ]

    whole = np.concatenate(rounds) * 1e6
    return Row(
        name,
        float(np.median(whole)),
        float(np.percentile(whole, 99)),
        float(whole.max()),
        baseline="udp_pace in C",
        ratio=float(np.median(ratios(50))),
        ratio_p99=float(np.median(ratios(99))),
        bound=bound,
        met=met,
        note=note,
        rounds=tuple(ratios(50)),
    )


def rows(label: str, measured: Measured) -> list[Row]:
    """Return the figures of one bridge."""
    trips = [pace.round_trip for pace in measured.baseline]
    floor = [np.abs(np.diff(pace.began) - PERIOD) for pace in measured.baseline]
    obeyed = float(np.median(np.concatenate(measured.obeyed)))
    jitter = float(np.percentile(np.concatenate(measured.jitter), 99))
    missed, unexcused = sum(measured.missed), sum(measured.unexcused)
    return [
        _row(f"{label}: reply to muscle_state", measured.published, trips),
        _row(
            f"{label}: override to wire",
            measured.obeyed,
            trips,
            f"median <= {OBEY_BOUND * 1e3:g} ms",
            obeyed <= OBEY_BOUND,
            f"{sum(one.size for one in measured.obeyed)} overrides, published serialised",
        ),
        _row(
            f"{label}: period jitter",
            measured.jitter,
            floor,
            f"p99 < {JITTER_BOUND * 1e3:g} ms",
            jitter < JITTER_BOUND,
        ),
        Row(
            f"{label}: missed periods",
            unexcused,
            unit="periods",
            bound="0 but for stalls of the machine",
            met=unexcused == 0 if measured.above_all else None,
            note=f"{missed} of {measured.periods} in all, the others in stalls of "
            f"{_STALL * PERIOD * 1e3:g} ms or more that a C program saw which runs before all "
            f"others; udp_pace at the bridge's own priority missed {measured.rival_missed}",
        ),
    ]


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; `scale` 1 takes about nine minutes. There is no plot."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        large = str(write_limbed_arm(folder, muscles=74, joints=33))
        variants: list[tuple[str, str, dict[str, object]]] = [
            ("10 boards", MUSASHI, {}),
            ("10 boards, tuned", MUSASHI, TUNED),
            ("74 boards", large, {}),
            ("74 boards, tuned", large, TUNED),
        ]
        found = {label: Measured() for label, _, _ in variants}
        for _ in range(ROUNDS if scale > 0.1 else 1):
            for label, robot, options in variants:
                measure(found[label], robot, folder, max(ROUND_SEC * scale, 2.0), **options)
    return [row for label, measured in found.items() for row in rows(label, measured)]


if __name__ == "__main__":
    for row in run(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0):
        print(row)
