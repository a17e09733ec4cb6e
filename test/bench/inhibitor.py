"""How long from a joint state to its override, beside an echo in C.

The installed inhibitor, with its real messages, model, status and diagnostics, is asked by a C
program that plays the bridge; echoes of ten numbers, in C and in rclpy, take turns with it.

scripts/ros_env python test/bench/inhibitor.py [SCALE]
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "demo"))

import rclpy
from baselines import baseline
from builtin_interfaces.msg import Duration
from limbed_arm import write_limbed_arm
from machine import AWAKE, TUNED, wakeful
from processes import Process, free_domain, isolated_environment
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from recording import cpu_seconds
from rounds import Row

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.srv import ArmInhibitor
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI

QUESTION = "How long from a joint state to its override, beside an echo in C?"

ROUNDS, MESSAGES, WARM_UP = 10, 2000, 200
STEADY_SEC, LONG_SEC, SEGMENT_SEC = 60.0, 600.0, 50.0
PERIODS_US = {"back to back": 0, "at 1 kHz": 1000}
RCLPY_ECHO = (sys.executable, str(Path(__file__).with_name("rclpy_echo.py")))
LEAST = "least inhibitor in Python"
LEAST_INHIBITOR = (sys.executable, str(Path(__file__).with_name("least_inhibitor.py")))
# A shared machine stalls for longer than a robot PC may.
TIMEOUTS = {"state_timeout": 0.3, "lease": 0.2, "max_time_limit": 60.0}
_DISCOVERY_SEC = 30.0

Figures = dict[str, float]


class Asker:
    """A node that arms the inhibitor."""

    def __init__(self, domain: int) -> None:
        """Join a ROS domain."""
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        self._node = Node("bench", context=self._context, enable_rosout=False)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._client = self._node.create_client(ArmInhibitor, "arm_inhibitor")

    def arm(self, goal: list[float]) -> None:
        """Arm for a minute, as soon as joint states come; raises RuntimeError."""
        deadline = time.monotonic() + _DISCOVERY_SEC
        last = "no answer"
        while time.monotonic() < deadline:
            if not self._client.wait_for_service(0.1):
                continue
            request = ArmInhibitor.Request(
                stamp=self._node.get_clock().now().to_msg(),
                goal_position=goal,
                time_limit=Duration(sec=60),
            )
            future = self._client.call_async(request)
            self._executor.spin_until_future_complete(future, timeout_sec=1.0)
            answer = future.result() if future.done() else None
            if answer is not None and answer.error_code in (ErrorCode.SUCCESS, ErrorCode.BUSY):
                return
            last = last if answer is None else answer.error_string
            time.sleep(0.05)
        raise RuntimeError(f"the inhibitor was not armed: {last}")

    def close(self) -> None:
        """Leave."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


class InhibitorBench:
    """An inhibitor, and the C program that asks it."""

    def __init__(self, folder: Path, description: str, **parameters: object) -> None:
        """Start the inhibitor for a robot."""
        self.robot: Robot = load_robot(description)
        domain = free_domain()
        self._environment = isolated_environment(domain)
        self.process = Process(
            "fastswing_inhibitor",
            "inhibitor",
            {"robot_description": description, **TIMEOUTS, **parameters},
            self._environment,
            folder / f"inhibitor_{domain}.log",
        )
        self._asker = Asker(domain)

    def ask(self, mode: str, count: int, period_us: int) -> Figures:
        """Let the C program ask so many times; returns what it prints."""
        goal = self.robot.postures["end"].tolist()
        try:
            figures = asked(
                self.robot,
                self._environment,
                mode,
                count,
                period_us,
                partial(self._asker.arm, goal),
            )
        except subprocess.CalledProcessError as error:
            raise RuntimeError(f"the inhibitor says:\n{self.process.log_tail()}") from error
        # The next swing is another one: this one ends when joint states stop.
        time.sleep(2.0 * TIMEOUTS["state_timeout"])
        return figures

    def close(self) -> None:
        """End the inhibitor."""
        self.process.send(2)
        self.process.wait(10.0)
        self._asker.close()


def asked(
    robot: Robot,
    environment: Mapping[str, str],
    mode: str,
    count: int,
    period_us: int,
    arm: Callable[[], None] = lambda: None,
) -> Figures:
    """Let the C program ask so many times, and arm meanwhile; returns what it prints."""
    starts, goals = robot.postures["start"].tolist(), robot.postures["end"].tolist()
    rows = zip(robot.model.joint_names, starts, goals, strict=True)
    arguments = [str(baseline("rcl_inhibit")), mode, str(count), str(WARM_UP), str(period_us)]
    with subprocess.Popen(
        arguments,
        env=dict(environment),
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as client:
        assert client.stdin is not None
        assert client.stdout is not None
        client.stdin.write("".join(f"{name} {a} {b}\n" for name, a, b in rows))
        client.stdin.close()
        arm()
        text = client.stdout.read()
    if client.returncode:
        raise subprocess.CalledProcessError(client.returncode, arguments)
    figures: Figures = json.loads(text)
    return figures


def least(robot: Robot, count: int, period_us: int) -> Figures:
    """Return what the least that an inhibitor in Python has to do takes."""
    environment = isolated_environment(free_domain())
    answering = subprocess.Popen((*LEAST_INHIBITOR, str(robot.path)), env=environment)
    try:
        return asked(robot, environment, "closed", count, period_us)
    finally:
        answering.kill()
        answering.wait()


def echo(count: int, period_us: int, server: Sequence[str] = ()) -> Figures:
    """Return what an echo takes; by the program in C unless another `server` is named."""
    environment = isolated_environment(free_domain())
    program = str(baseline("rcl_echo"))
    echoing = subprocess.Popen(
        server or (program, "server", "0"), env=environment, stderr=subprocess.DEVNULL
    )
    try:
        arguments = [program, "client", "0", str(count), str(WARM_UP), str(period_us)]
        done = subprocess.run(
            arguments, env=environment, capture_output=True, text=True, check=True
        )
    finally:
        echoing.terminate()
        echoing.wait()
    figures: Figures = json.loads(done.stdout)
    return figures


def in_turns(
    programs: Mapping[str, Callable[[], Figures]], rounds: int
) -> dict[str, list[Figures]]:
    """Run all programs, one after another, so many times."""
    results: dict[str, list[Figures]] = {name: [] for name in programs}
    for _ in range(rounds):
        for name, program in programs.items():
            results[name].append(program())
    return results


def compared(results: Mapping[str, list[Figures]], name: str, base: str) -> Row:
    """Return a row with the ratios of each round to the base's of the same round."""
    own, other = results[name], results[base]
    ratios = tuple(a["p50"] / b["p50"] for a, b in zip(own, other, strict=True))
    tails = [a["p99"] / b["p99"] for a, b in zip(own, other, strict=True)]
    return replace(
        plain(results, name),
        baseline=base,
        ratio=statistics.median(ratios),
        ratio_p99=statistics.median(tails),
        rounds=ratios,
    )


def plain(results: Mapping[str, list[Figures]], name: str) -> Row:
    """Return a row that is compared with nothing."""
    own = results[name]
    lost = sum(int(figures["lost"]) for figures in own)
    return Row(
        name,
        statistics.median(figures["p50"] for figures in own),
        statistics.median(figures["p99"] for figures in own),
        max(figures["max"] for figures in own),
        note=f"{lost} of {sum(int(figures.get('sent', figures['n'])) for figures in own)} lost",
    )


def judged(row: Row, ratio: float, ratio_p99: float | None, text: str) -> Row:
    """Return the row with what was asked for."""
    assert row.ratio is not None
    assert row.ratio_p99 is not None
    met = row.ratio <= ratio and (ratio_p99 is None or row.ratio_p99 <= ratio_p99)
    return replace(row, bound=text, met=met)


def _beside_echo(results: Mapping[str, list[Figures]], name: str) -> Row:
    return judged(compared(results, name, "C echo"), 1.5, 2.5, "median <= 1.5, p99 <= 2.5")


def _beside_wakeful_echo(results: Mapping[str, list[Figures]], name: str) -> Row:
    row = compared(results, name, f"C echo{AWAKE}")
    row = judged(row, 1.5, 2.5, "median <= 1.5, p99 <= 2.5")
    return replace(row, name=f"{name}, beside an echo while no core sleeps")


@contextmanager
def met_by_programs() -> Iterator[None]:
    """Let what asks from this process meet the programs that do."""
    kept = dict(os.environ)
    os.environ.update(isolated_environment(free_domain()))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(kept)


@contextmanager
def benches(folder: Path) -> Iterator[dict[str, InhibitorBench]]:
    """Start inhibitors: of ten muscles, of 74, without and with more of the kernel's rights.

    As started, an inhibitor keeps the cores awake while it is armed, if the kernel grants that.
    """
    large = write_limbed_arm(folder, muscles=74, joints=33)
    running: dict[str, InhibitorBench] = {}
    try:
        running["inhibitor"] = InhibitorBench(folder, MUSASHI)
        running["inhibitor, 74 muscles"] = InhibitorBench(folder, str(large))
        running["inhibitor, cores sleep"] = InhibitorBench(
            folder, MUSASHI, prevent_core_sleep=False
        )
        running["inhibitor, tuned"] = InhibitorBench(folder, MUSASHI, **TUNED)
        yield running
    finally:
        for bench in running.values():
            bench.close()


def round_trips(running: Mapping[str, InhibitorBench], scale: float) -> list[Row]:
    """Compare round trips, back to back and paced."""
    rounds = max(round(ROUNDS * min(scale * 10.0, 1.0)), 1)
    rows: list[Row] = []
    for pace, period in PERIODS_US.items():
        # The first hundreds are slower: of those back to back, which cost little, never so few.
        share = min(scale if period else 4.0 * scale, 1.0)
        count = max(round(MESSAGES * share), 100)
        rows += [
            replace(
                one, name=f"{one.name}, {pace}", baseline=one.baseline and f"{one.baseline}, {pace}"
            )
            for one in _compared_trips(in_turns(_programs(running, count, period), rounds))
        ]
    return rows


def _programs(
    running: Mapping[str, InhibitorBench], count: int, period: int
) -> dict[str, Callable[[], Figures]]:
    musashi = running["inhibitor"].robot
    larger = running["inhibitor, 74 muscles"].robot
    echoes = {
        "C echo": partial(echo, count, period),
        "rclpy echo": partial(echo, count, period, RCLPY_ECHO),
        LEAST: partial(least, musashi, count, period),
        f"{LEAST}, 74 muscles": partial(least, larger, count, period),
    }
    return {
        **echoes,
        **{name: partial(bench.ask, "closed", count, period) for name, bench in running.items()},
        **{f"{name}{AWAKE}": partial(wakeful, one) for name, one in echoes.items()},
    }


def _compared_trips(results: Mapping[str, list[Figures]]) -> list[Row]:
    large = compared(results, "inhibitor, 74 muscles", "inhibitor")
    return [
        plain(results, "C echo"),
        compared(results, "rclpy echo", "C echo"),
        compared(results, LEAST, "C echo"),
        compared(results, f"{LEAST}, 74 muscles", LEAST),
        plain(results, f"C echo{AWAKE}"),
        compared(results, f"rclpy echo{AWAKE}", f"C echo{AWAKE}"),
        compared(results, f"{LEAST}{AWAKE}", f"C echo{AWAKE}"),
        compared(results, f"{LEAST}, 74 muscles{AWAKE}", f"{LEAST}{AWAKE}"),
        _beside_echo(results, "inhibitor"),
        _beside_wakeful_echo(results, "inhibitor"),
        _beside_echo(results, "inhibitor, cores sleep"),
        _beside_echo(results, "inhibitor, tuned"),
        _beside_wakeful_echo(results, "inhibitor, tuned"),
        judged(large, 1.3, None, "median <= 1.3"),
    ]


def steady(
    name: str, bench: InhibitorBench, rate_hz: int, seconds: float, least: float
) -> list[Row]:
    """Publish at a rate, whatever comes back; return the share answered, and its cost."""
    sent = answered = disorder = 0
    used: list[float] = []
    parts: list[Figures] = []
    while sent < seconds * rate_hz:
        count = round(min(SEGMENT_SEC, seconds - sent / rate_hz) * rate_hz)
        before = cpu_seconds(bench.process.pid)
        figures = bench.ask("open", count, 1_000_000 // rate_hz)
        # Of the time in which states came; what arming costs is counted in.
        used.append(100.0 * (cpu_seconds(bench.process.pid) - before) * rate_hz / count)
        sent, answered = sent + int(figures["sent"]), answered + int(figures["n"])
        disorder += int(figures["out_of_order"])
        parts.append(figures)
    share = 100.0 * answered / sent
    name = f"{name} at {rate_hz // 1000} kHz for {sent / rate_hz:g} s"
    return [
        Row(
            f"{name}: joint states answered",
            share,
            unit="%",
            bound=f">= {least:g} %, none out of order",
            met=share >= least and not disorder,
            note=f"{sent - answered} of {sent} not answered, {disorder} out of order",
        ),
        Row(
            f"{name}: state to override",
            statistics.median(figures["p50"] for figures in parts),
            statistics.median(figures["p99"] for figures in parts),
            max(figures["max"] for figures in parts),
        ),
        Row(
            f"{name}: CPU",
            statistics.median(used),
            unit="% of a core",
            bound="< 25 %" if rate_hz == 1000 else "",
            met=statistics.median(used) < 25.0 if rate_hz == 1000 else None,
        ),
    ]


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Return all figures; 1.0 takes some minutes, 0.02 some seconds. It draws nothing."""
    seconds = max(STEADY_SEC * scale, 2.0)
    with (
        met_by_programs(),
        tempfile.TemporaryDirectory() as folder,
        benches(Path(folder)) as running,
    ):
        rows = round_trips(running, scale)
        for name in ("inhibitor", "inhibitor, tuned"):
            rows += steady(name, running[name], 1000, seconds, 99.9)
            rows += steady(name, running[name], 2000, seconds, 99.0)
        return rows


def run_long() -> list[Row]:
    """Return the figures of ten minutes at 1 kHz."""
    with met_by_programs(), tempfile.TemporaryDirectory() as folder:
        bench = InhibitorBench(Path(folder), MUSASHI, **TUNED)
        try:
            return steady("inhibitor, tuned", bench, 1000, LONG_SEC, 99.9)
        finally:
            bench.close()


def _printed(row: Row) -> str:
    def number(value: Any) -> str:
        return "" if value is None else f"{value:9.2f}"

    columns = (row.median, row.p99, row.maximum, row.ratio, row.ratio_p99)
    verdict = {True: "met", False: "NOT MET", None: ""}[row.met]
    return (
        f"{row.name:45}{' '.join(f'{number(value):9}' for value in columns)} {row.unit:12}"
        f"{row.bound} {verdict} {row.note}"
    )


def main() -> None:
    """Print the figures."""
    for row in run(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0):
        print(_printed(row))


if __name__ == "__main__":
    main()
