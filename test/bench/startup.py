"""How long each executable takes to start, and what it imports that it could do without."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from processes import (
    Process,
    free_domain,
    free_udp_port,
    isolated_environment,
    stop_all,
)
from rclpy.experimental import EventsExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rounds import Program, Row, Samples, in_turns, row

QUESTION = "How long does each executable take to import, and to its first message?"
PACKAGES = ("fastswing_inhibitor", "fastswing_planner", "musashi_muscle_bridge")
NODES = {
    "mock_driver": "musashi_muscle_bridge",
    "bridge": "musashi_muscle_bridge",
    "planner": "fastswing_planner",
    "swing_executor": "fastswing_planner",
    "inhibitor": "fastswing_inhibitor",
    "record": "fastswing_planner",
}
NODE_NAMES = {"record": "recorder"}
MOST_MS = 1000.0
BASELINE = "rclpy, numpy and mujoco"
_HEAVY = ("matplotlib", "scipy", "pandas", "PIL", "rosbags", "mcap", "proxsuite", "daqp", "mujoco")
_READY_SEC = 60.0


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; 1.0 takes about three minutes. Nothing is drawn."""
    rounds = max(1, round(5 * scale))
    commands = {one.name: one for one in entry_points(group="console_scripts") if _ours(one)}
    if scale < 0.1:
        commands = {"inhibitor": commands["inhibitor"]}
    return _import_rows(commands, rounds) + _message_rows(list(commands), rounds)


def _ours(entry: EntryPoint) -> bool:
    return entry.value.partition(".")[0] in PACKAGES


def _import_rows(commands: dict[str, EntryPoint], rounds: int) -> list[Row]:
    programs: dict[str, Program] = {BASELINE: partial(imported, "rclpy, numpy, mujoco")}
    for name, entry in commands.items():
        programs[name] = partial(imported, entry.module)
    found = in_turns(programs, rounds)
    rows = [row(f"import {BASELINE}", found[BASELINE])]
    for name, entry in commands.items():
        note = ", ".join(heavy(entry.module))
        rows.append(
            row(f"import {name}", found[name], against=(BASELINE, found[BASELINE]), note=note)
        )
    return rows


def imported(modules: str) -> Samples:
    """Return the time [s] that a new process takes to import modules."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", f"import {modules}"], check=True)
    return np.array([time.perf_counter() - begin])


def heavy(module: str) -> list[str]:
    """Return the heavy packages that a module imports."""
    code = f"import {module}, sys; print(*(m for m in {_HEAVY!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def _message_rows(names: list[str], rounds: int) -> list[Row]:
    rows = []
    for name in (one for one in names if one in NODES):
        pairs = [first_message(name) for _ in range(rounds)]
        since_discovery = [np.array([after]) for _, after in pairs]
        since_start = [np.array([whole]) for whole, _ in pairs]
        rows.append(row(f"{name}, discovery to first message", since_discovery, at_most=MOST_MS))
        rows.append(row(f"{name}, start to first message", since_start))
    return rows


def first_message(name: str) -> tuple[float, float]:
    """Start a node; return the time [s] to its first diagnostics, since the start and discovery."""
    domain = free_domain()
    environment = isolated_environment(domain)
    os.environ.update(environment)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(
        "waiting", context=context, enable_rosout=False, start_parameter_services=False
    )
    heard = Future()
    wanted = NODE_NAMES.get(name, name)

    def hear(message: DiagnosticArray) -> None:
        if not heard.done() and any(status.name == wanted for status in message.status):
            heard.set_result(time.perf_counter())

    qos = QoSProfile(depth=100, durability=DurabilityPolicy.VOLATILE)
    node.create_subscription(DiagnosticArray, "/diagnostics", hear, qos)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    with tempfile.TemporaryDirectory() as folder:
        parameters = _parameters(name, Path(folder))
        begin = time.perf_counter()
        process = Process(NODES[name], name, parameters, environment, Path(folder) / "log")
        try:
            discovered = _wait(
                lambda: node.count_publishers("/diagnostics") > 0, executor, process, begin
            )
            came = _wait(heard.done, executor, process, begin) and float(heard.result() or 0.0)
        finally:
            stop_all([process])
            node.destroy_node()
            rclpy.shutdown(context=context)
    return came - begin, max(came - discovered, 0.0)


def _wait(
    done: Callable[[], bool], executor: EventsExecutor, process: Process, begin: float
) -> float:
    while not done():
        if time.perf_counter() - begin > _READY_SEC or not process.running:
            raise TimeoutError(f"{process.name} publishes no diagnostics: {process.log_tail()}")
        executor.spin_until_future_complete(Future(), timeout_sec=0.002)
    return time.perf_counter()


def _parameters(name: str, folder: Path) -> dict[str, object]:
    if name in ("bridge", "mock_driver"):
        return {"bus_url": f"udp://127.0.0.1:{free_udp_port()}"}
    return {"output": folder / "bag.mcap"} if name == "record" else {}
