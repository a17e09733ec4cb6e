"""How faults are made."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from bench import Bench, Disturbed, Swing
from board_lines import CURRENT, TENSION, ZERO
from builtin_interfaces.msg import Duration
from lifecycle_msgs.msg import State
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import (
    CurrentCommand,
    ErrorCode,
    LengthCommand,
    SwingOptions,
    TensionCommand,
)
from fastswing_msgs.srv import ArmInhibitor

FOREIGN_STATES = 20
_BURNERS = 2
_DISK_BYTES = 256 * 1024


class NotPossible(Exception):
    """This machine does not let us make the fault; the text says why."""


# Recovery.


def clear(bench: Bench) -> None:
    """Clear the faults and wait until all muscles hold."""
    bench.suite.fresh_muscles()
    bench.suite.hold()


def end_extra(bench: Bench) -> None:
    """End what the fault made."""
    for thing in bench.extra:
        thing()
    bench.extra.clear()


def real_time(bench: Bench) -> None:
    """Take the nodes off simulated time."""
    for name in sorted(bench.simulated):
        bench.set(name, use_sim_time=False)
    bench.simulated.clear()


# Processes.


def end_or_stop(bench: Bench, node: str, signal_number: int) -> None:
    """Send a signal; wait for the end unless it only stops."""
    if signal_number == signal.SIGSTOP:
        bench.suite.processes[node].send(signal_number)
    else:
        bench.kill(node, signal_number)


def boards_that_hold(bench: Bench) -> bool:
    """Before the fault: a bridge whose boards hold when its frames stop, for this fault alone."""

    def end() -> None:
        bench.kill("bridge", signal.SIGINT)

    end()
    bench.suite.start("bridge", watchdog_action="hold_length")
    bench.suite.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    bench.suite.hold()
    bench.extra.append(end)
    return False


def end_or_stop_control(bench: Bench, signal_number: int) -> None:
    """Send a signal to the process in which the bridge runs its control loop."""
    (control,) = bench.control_processes()
    os.kill(control, signal_number)


def end_and_restart(bench: Bench, node: str) -> None:
    """End a node with SIGINT and start it again."""
    bench.kill(node, signal.SIGINT)
    bench.restart(node)


# Messages.


def not_a_number(message: JointState) -> None:
    """Make the positions NaN."""
    message.position = [float("nan")] * len(message.name)


def absurd(message: JointState) -> None:
    """Make the positions 100 rad."""
    message.position = [100.0] * len(message.name)


def renamed(message: JointState) -> None:
    """Name joints that the robot does not have."""
    message.name = [f"not {name}" for name in message.name]


def reordered(message: JointState) -> None:
    """Turn the order of all columns."""
    message.name = list(message.name)[::-1]
    message.position = list(message.position)[::-1]
    message.velocity = list(message.velocity)[::-1]


def misnamed(message: JointState) -> None:
    """Turn the order of the names alone."""
    message.name = list(message.name)[::-1]


def foreign_joint_states(change: Callable[[JointState], None]) -> Callable[[Bench], None]:
    """Return an injection: a second publisher repeats joint states, changed."""

    def inject(bench: Bench) -> None:
        sent = 0

        def published() -> bool:
            nonlocal sent
            message, bench.genuine = bench.genuine, None
            if message is not None:
                change(message)
                bench.foreign_states.publish(message)
                sent += 1
            return sent >= FOREIGN_STATES

        bench.suite.until("joint states to change", published)

    return inject


def muscle_states_of_nan(bench: Bench) -> None:
    """Repeat muscle states from a second publisher, with lengths that are no numbers."""
    sent = 0

    def published() -> bool:
        nonlocal sent
        message, bench.genuine_muscles = bench.genuine_muscles, None
        if message is not None:
            message.length = [float("nan")] * len(message.name)
            bench.foreign_muscles.publish(message)
            sent += 1
        return sent >= FOREIGN_STATES

    bench.suite.until("muscle states to change", published)


def _publish(
    bench: Bench, kind: Any, topic: str, make: Callable[[], Any], seconds: float, qos: QoSProfile
) -> None:
    """Publish a command at about 100 Hz; the publisher stays until `end_extra`."""
    suite = bench.suite
    publisher = suite.node.create_publisher(kind, topic, qos)
    timer = suite.node.create_timer(0.01, lambda: publisher.publish(make()))

    def end() -> None:
        suite.node.destroy_timer(timer)
        suite.node.destroy_publisher(publisher)

    bench.extra.append(end)
    if qos.reliability is not ReliabilityPolicy.BEST_EFFORT:
        suite.until(f"the bridge on {topic}", lambda: publisher.get_subscription_count() >= 1)
    deadline = time.monotonic() + seconds
    suite.until("some commands", lambda: time.monotonic() > deadline)


def _obeyed(bench: Bench, mode: str, seconds: float) -> None:
    """Wait until the boards obey commands of a mode, and then for so long [s]."""
    bench.suite.until("the commands to arrive", lambda: mode in bench.lines.commands[-1].modes)
    deadline = time.monotonic() + seconds
    bench.suite.until("the commands' end", lambda: time.monotonic() > deadline)


def length_commands(value: float) -> Callable[[Bench], None]:
    """Return an injection: commands of this length [m] for #9."""

    def inject(bench: Bench) -> None:
        def make() -> LengthCommand:
            return LengthCommand(header=bench.suite.now(), name=["#9"], length=[value])

        _publish(bench, LengthCommand, "length_command", make, 0.5, QoSProfile(depth=10))

    return inject


def tension_commands(bench: Bench) -> None:
    """Ask for an absurd tension of #9, then fall silent."""

    def make() -> TensionCommand:
        return TensionCommand(header=bench.suite.now(), name=["#9"], tension=[1e6])

    _publish(bench, TensionCommand, "tension_command", make, 0.0, QoSProfile(depth=10))
    _obeyed(bench, TENSION, 0.5)
    end_extra(bench)


def current_commands(current: float, seconds: float) -> Callable[[Bench], None]:
    """Return an injection: commands of this current [A] for #9, then silence."""

    def inject(bench: Bench) -> None:
        def make() -> CurrentCommand:
            return CurrentCommand(header=bench.suite.now(), name=["#9"], current=[current])

        _publish(bench, CurrentCommand, "current_command", make, 0.0, QoSProfile(depth=10))
        _obeyed(bench, CURRENT, seconds)
        end_extra(bench)

    return inject


def second_publisher(bench: Bench) -> None:
    """Be a second publisher of length_command that says nothing."""
    publisher = bench.suite.node.create_publisher(LengthCommand, "length_command", 10)
    bench.extra.append(lambda: bench.suite.node.destroy_publisher(publisher))


def best_effort_commands(bench: Bench) -> None:
    """Publish length commands that the bridge's subscription cannot take."""
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

    def make() -> LengthCommand:
        return LengthCommand(header=bench.suite.now(), name=["#9"], length=[0.1])

    _publish(bench, LengthCommand, "length_command", make, 0.5, qos)


def arm_again(bench: Bench) -> None:
    """Ask an armed inhibitor to arm; it has to say that it is busy."""
    goal = bench.suite.goal()
    request = ArmInhibitor.Request(
        stamp=bench.suite.now().stamp,
        goal_position=goal.end_position,
        time_limit=Duration(sec=1),
        threshold=0.0,
    )
    answer = bench.suite.ask(ArmInhibitor, "arm_inhibitor", request)
    if answer.error_code == ErrorCode.SUCCESS:
        raise Disturbed("the inhibitor was asked too late: its swing was over")
    assert answer.error_code == ErrorCode.BUSY, answer.error_string
    bench.notes.append(f"answer: {answer.error_string}")


# Time.


def jump(seconds: float) -> Callable[[Bench], None]:
    """Return an injection: the clock of all nodes jumps by so much [s]."""
    return lambda bench: bench.run_clock(seconds)


def on_simulated_time(bench: Bench) -> bool:
    """Before the swing: all nodes take their time from a sound /clock."""
    bench.run_clock(0.0)
    bench.simulate_time("bridge", "swing_executor", "inhibitor", "planner")
    return False


def fresh_nodes(bench: Bench) -> bool:
    """Before the fault: nodes that never heard a clock, else the last time they heard stays."""
    for name in ("bridge", "swing_executor", "inhibitor"):
        bench.kill(name, signal.SIGINT)
        bench.restart(name)
    clear(bench)
    return False


def stop_clock(bench: Bench) -> None:
    """Let /clock fall silent."""
    bench.run_clock(None)


def no_clock(bench: Bench) -> None:
    """Put all nodes on simulated time without a clock, and ask for a swing."""
    bench.run_clock(None)
    bench.simulate_time("bridge", "swing_executor", "inhibitor", "planner")
    bench.swing = Swing(bench.suite, SwingOptions.METHOD_INHIBIT)


# Machine.


def swing_by_task_code(bench: Bench) -> bool:
    """Let another process ask for the swing; wait until muscles are let go."""
    since = time.monotonic()
    _task_code(bench, "swing")
    bench.suite.until(
        "muscles let go",
        lambda: any(ZERO in line.modes for line in bench.lines.commands_since(since)),
    )
    return True


def kill_task_code(bench: Bench) -> None:
    """Kill the process that asked for the swing, and start it again, as a listener."""
    end_extra(bench)
    _task_code(bench, "listen")


def _task_code(bench: Bench, what: str) -> None:
    program = Path(__file__).with_name("task_code.py")
    process = subprocess.Popen([sys.executable, str(program), what], env=bench.environment)

    def end() -> None:
        process.kill()
        process.wait()

    bench.extra.append(end)


def burn(bench: Bench) -> None:
    """Keep as many cores busy as this machine has, at least two."""
    burners = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(max(_BURNERS, os.cpu_count() or 1))
    ]

    def end() -> None:
        for burner in burners:
            burner.kill()
            burner.wait()

    bench.extra.append(end)


def small_disk(bench: Bench) -> Path:
    """Mount a small disk for the recorder; raises NotPossible where that is not permitted."""
    folder = Path(tempfile.mkdtemp(dir=bench.folder))
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_DISK_BYTES}", "tmpfs", str(folder)]
    done = subprocess.run(mount, capture_output=True, text=True)
    if done.returncode != 0:
        raise NotPossible(f"no small disk: {done.stderr.strip()}")

    def end() -> None:
        with suppress(OSError, subprocess.SubprocessError):
            subprocess.run(["umount", "--lazy", str(folder)], check=False, timeout=10.0)

    bench.extra.append(end)
    return folder


def fill_disk(bench: Bench) -> None:
    """Record onto a disk with hardly any room."""
    _record(bench, small_disk(bench) / "bag.mcap")


def kill_recorder(bench: Bench) -> None:
    """Kill a recorder at work."""
    _record(bench, bench.folder / f"bag_{time.monotonic_ns()}.mcap")
    bench.suite.let_states_pass(20)
    bench.kill("record")
    bench.suite.processes.pop("record")


def _record(bench: Bench, output: Path) -> None:
    process = bench.suite.start("record", output=output, compression="none", flush_period=0.05)

    def end() -> None:
        process.send(signal.SIGINT)
        process.wait(60.0)
        bench.suite.processes.pop("record", None)  # another fault may have taken it

    bench.extra.insert(0, end)
    bench.suite.until("the recorder's diagnostics", lambda: "recorder" in bench.suite.diagnostics)
