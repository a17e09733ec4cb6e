"""Lets all nodes swing for a long time, and measures memory, rates and rejections of each.

Writes summary.json, samples.csv and soak.png into the output folder, and prints a table. Ends with
1 if a node ended by itself or memory, rates or rejections are not what docs/soak.md promises.
"""

import argparse
import csv
import json
import os
import platform
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "demo"))

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from processes import Process, free_domain, free_udp_port, isolated_environment, stop_all
from rclpy.signals import SignalHandlerOptions
from soak_picture import draw
from std_srvs.srv import Trigger
from three_swings import Client

from fastswing_msgs.msg import ErrorCode, SwingOptions
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

METHODS = {
    "basic": SwingOptions.METHOD_BASIC,
    "inhibit": SwingOptions.METHOD_INHIBIT,
    "elongate": SwingOptions.METHOD_ELONGATE,
    "hybrid": SwingOptions.METHOD_HYBRID,
}
TIMEOUT_SEC = 0.5
"""As in the demo: a shared desktop stalls for longer than a robot PC may."""
PERIOD_SEC = 10.0
SAMPLE_SEC = 1.0
WARM_UP = 0.3
"""Share of the run that does not count for slopes: caches fill, heaps grow to their size."""
MAX_SLOPE = 100.0
"""[kB/min] of memory; 6 MB an hour."""
MAX_DRIFT = 0.05
"""Share by which a rate may differ between the first and the last third after the warm-up."""
_READY_SEC = 60.0
_PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024.0
_COUNTERS = {"bridge": "replies", "inhibitor": "joint_states", "mock_driver": "frames"}


@dataclass
class Samples:
    """What was sampled, a row per SAMPLE_SEC.

    rss      [kB] of each node, by name
    counts   of frames or states since the start, by node: (time of the diagnostics [s], count)
    """

    times: list[float] = field(default_factory=list)
    rss: dict[str, list[float]] = field(default_factory=dict)
    counts: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    outcomes: dict[str, int] = field(default_factory=dict)
    swings: dict[str, int] = field(default_factory=dict)
    status: dict[str, DiagnosticStatus] = field(default_factory=dict)


def resident_kb(pid: int) -> float:
    """Return a process's resident memory [kB]."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    pages = sum(int(Path(f"/proc/{one}/statm").read_text().split()[1]) for one in (pid, *children))
    return pages * _PAGE_KB


def values(status: DiagnosticStatus) -> dict[str, str]:
    """Return a status's values by key."""
    return {value.key: value.value for value in status.values}


def rejections(status: Mapping[str, DiagnosticStatus]) -> dict[str, int]:
    """Return what the nodes rejected, by node and reason."""
    return {
        f"{node} {key}": int(value)
        for node, last in status.items()
        for key, value in values(last).items()
        if key.startswith("rejected_") or key == "callback_errors"
        if int(value) > 0
    }


def slope_kb_min(times: Sequence[float], rss: Sequence[float]) -> float:
    """Return the slope [kB/min] of a straight line through what follows the warm-up."""
    first = int(len(times) * WARM_UP)
    if len(times) - first < 3:
        return float("nan")
    return float(np.polyfit(times[first:], rss[first:], 1)[0] * 60.0)


def rates(counts: Sequence[tuple[float, int]]) -> tuple[float, float]:
    """Return the rate [Hz] in the first and the last third after the warm-up."""
    tail = counts[int(len(counts) * WARM_UP) :]
    third = len(tail) // 3
    if third < 2:
        return float("nan"), float("nan")

    def rate(part: Sequence[tuple[float, int]]) -> float:
        (start, low), (end, high) = part[0], part[-1]
        return (high - low) / (end - start)

    return rate(tail[:third]), rate(tail[-third:])


def start_nodes(environment: dict[str, str], logs: Path, rate: float) -> list[Process]:
    """Start all nodes."""
    bus = {"bus_url": f"udp://127.0.0.1:{free_udp_port()}"}
    nodes: list[tuple[str, str, dict[str, Any]]] = [
        ("musashi_muscle_bridge", "mock_driver", bus),
        (
            "musashi_muscle_bridge",
            "bridge",
            {**bus, "control_rate": rate, "watchdog_timeout": TIMEOUT_SEC},
        ),
        ("fastswing_planner", "planner", {}),
        ("fastswing_planner", "swing_executor", {"state_timeout": TIMEOUT_SEC}),
        ("fastswing_inhibitor", "inhibitor", {"state_timeout": TIMEOUT_SEC, "lease": 0.2}),
    ]
    return [
        Process(package, name, parameters, environment, logs / f"{name}.log")
        for package, name, parameters in nodes
    ]


class Soak:
    """Nodes, a client, and samples of them."""

    def __init__(self, processes: Sequence[Process]) -> None:
        """Sample from now on."""
        self.samples = Samples()
        self._processes = processes
        self._client = Client(processes)
        node = self._client.node
        node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 100)
        self._clear = node.create_client(Trigger, "clear_faults")
        for name in ("mock_driver", "bridge", "planner", "swing_executor", "inhibitor"):
            self._client.wait_until_active(name)
        self._start = time.monotonic()
        node.create_timer(SAMPLE_SEC, self._sample)

    def _hear(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            self.samples.status[status.name] = status
            count = values(status).get(_COUNTERS.get(status.name, ""))
            if count is not None:
                self.samples.counts.setdefault(status.name, []).append((now, int(count)))

    def _sample(self) -> None:
        self.samples.times.append(time.monotonic() - self._start)
        for process in self._processes:
            self.samples.rss.setdefault(process.name, []).append(resident_kb(process.pid))

    def run(self, seconds: float) -> None:
        """Swing every PERIOD_SEC, by each method in turn."""
        robot = load_robot(MUSASHI)
        count = 0
        while (due := count * PERIOD_SEC) < seconds:
            self._pass_until(due)
            name = list(METHODS)[count % len(METHODS)]
            result = self._client.swing(robot, METHODS[name], lambda _phase: None)
            success = result.error_code == ErrorCode.SUCCESS
            outcome = "success" if success else result.error_string
            self.samples.outcomes[outcome] = self.samples.outcomes.get(outcome, 0) + 1
            self.samples.swings[name] = self.samples.swings.get(name, 0) + success
            if not success:
                print(f"{due:6.0f} s  {name}: {outcome}", flush=True)
                cleared = self._clear.call_async(Trigger.Request())
                self._client.wait_for(cleared, _READY_SEC, "clear_faults")
            count += 1
        self._pass_until(seconds)

    def _pass_until(self, due: float) -> None:
        end = self._start + due
        self._client.spin_until(
            lambda: time.monotonic() >= end, max(end - time.monotonic(), 0.0) + 60.0, "waiting"
        )

    def close(self) -> None:
        """Leave ROS."""
        self._client.close()


def summary(samples: Samples, rate: float, codes: Mapping[str, int]) -> dict[str, Any]:
    """Return all figures, and what is not as promised."""
    nodes = {}
    for name, rss in samples.rss.items():
        first, last = rates(samples.counts.get(name, []))
        nodes[name] = {
            "rss_start_kb": rss[0],
            "rss_end_kb": rss[-1],
            "rss_slope_kb_min": round(slope_kb_min(samples.times, rss), 2),
            "rate_first_hz": round(first, 2),
            "rate_last_hz": round(last, 2),
            "exit_code": codes[name],
        }
    bridge = values(samples.status["bridge"])
    figures: dict[str, Any] = {
        "date": time.strftime("%Y-%m-%d"),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, shared",
        "minutes": round(samples.times[-1] / 60.0, 2),
        "control_rate_hz": rate,
        "swings": samples.outcomes,
        "successful_by_method": samples.swings,
        "rejections": rejections(samples.status),
        "bridge": {
            key: bridge[key]
            for key in ("replies", "misses", "overruns", "success_rate", "worst_lateness_ms")
        },
        "nodes": nodes,
    }
    figures["not_as_promised"] = problems(figures)
    return figures


def problems(figures: Mapping[str, Any]) -> list[str]:
    """Return what is not as promised, in words; comparisons with NaN are no problem."""
    found = [f"rejected: {name}: {count}" for name, count in figures["rejections"].items()]
    for name, node in figures["nodes"].items():
        if node["rss_slope_kb_min"] > MAX_SLOPE:
            found.append(f"{name} grows by {node['rss_slope_kb_min']:g} kB/min")
        first, last = node["rate_first_hz"], node["rate_last_hz"]
        if abs(last - first) > MAX_DRIFT * first:
            found.append(f"the rate of {name} went from {first:g} to {last:g} Hz")
        if node["exit_code"] != 0:
            found.append(f"{name} ended with {node['exit_code']}")
    return found


def table(figures: Mapping[str, Any]) -> str:
    """Return the nodes' figures as a Markdown table."""
    lines = [
        "| node | memory at start → end [MB] | slope after warm-up [kB/min] | rate, first → last "
        "third [Hz] | exit code |",
        "|---|---|---|---|---|",
    ]
    for name, node in figures["nodes"].items():
        first, last = node["rate_first_hz"], node["rate_last_hz"]
        rate = "" if first != first else f"{first:.1f} → {last:.1f}"
        lines.append(
            f"| `{name}` | {node['rss_start_kb'] / 1024:.1f} → {node['rss_end_kb'] / 1024:.1f} | "
            f"{node['rss_slope_kb_min']:.1f} | {rate} | {node['exit_code']} |"
        )
    return "\n".join(lines)


def write(samples: Samples, figures: Mapping[str, Any], output: Path) -> None:
    """Write the results."""
    (output / "summary.json").write_text(json.dumps(figures, indent=2) + "\n")
    with (output / "samples.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *(f"{name}_rss_kb" for name in samples.rss)])
        writer.writerows(zip(samples.times, *samples.rss.values(), strict=True))
    draw(samples.times, samples.rss, samples.counts, output / "soak.png")


def main() -> int:
    """Run the soak; returns 1 if something is not as promised."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="control rate [Hz]")
    parser.add_argument("--output", type=Path, default=Path("out/soak"))
    arguments = parser.parse_args()
    environment = isolated_environment(free_domain())
    os.environ.update(environment)
    logs = arguments.output / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    processes = start_nodes(environment, logs, arguments.rate)
    soak: Soak | None = None
    try:
        soak = Soak(processes)
        soak.run(arguments.minutes * 60.0)
    finally:
        codes = stop_all(processes, _READY_SEC)
        if soak is not None:
            soak.close()
        rclpy.try_shutdown()
    figures = summary(soak.samples, arguments.rate, codes)
    write(soak.samples, figures, arguments.output)
    print(table(figures))
    print(f"swings: {figures['swings']}; bridge: {figures['bridge']}")
    for problem in figures["not_as_promised"]:
        print(f"not as promised: {problem}")
    return 1 if figures["not_as_promised"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
