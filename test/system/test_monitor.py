"""The terminal dashboard, driven as a person would, with bridge and emulated arm over DDS."""

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from lifecycle_msgs.msg import State
from processes import Process, executable, free_domain, isolated_environment, stop_all

from fastswing_msgs.msg import MuscleState
from test.system.pseudo_terminal import PseudoTerminal

if TYPE_CHECKING:
    from test.system.suite import Suite


END_SEC = 60.0
PATIENT_SEC = 2.0
MONITOR = "musashi_muscle_bridge", "monitor"
Opened = Callable[..., PseudoTerminal]


@pytest.fixture
def opened() -> Iterator[Opened]:
    """Return a function that starts a monitor in a terminal."""
    terminals: list[PseudoTerminal] = []

    def open_one(domain: int, *ros_arguments: str, **variables: str) -> PseudoTerminal:
        command = [str(executable(*MONITOR))]
        if ros_arguments:
            command += ["--ros-args", *ros_arguments]
        terminals.append(PseudoTerminal(command, {**isolated_environment(domain), **variables}))
        return terminals[-1]

    yield open_one
    for terminal in terminals:
        terminal.close()


def holding_arm(suite: "Suite") -> None:
    # A stall of this machine must not trip the boards' watchdog: it is not what is tried here.
    suite.start("bridge", watchdog_timeout=PATIENT_SEC)
    suite.start_active("mock_driver")
    suite.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    suite.hold()


@pytest.fixture(scope="module")
def arm(new_suite: "Suite") -> "Suite":
    """Start bridge and emulated arm."""
    holding_arm(new_suite)
    return new_suite


@pytest.fixture
def terminal(arm: "Suite", opened: Opened) -> PseudoTerminal:
    """Return a monitor that shows the emulated arm, whose muscles hold."""
    arm.hold()
    shown = opened(arm.domain)
    arm.until("the muscles on the screen", lambda: " length" in shown.row("#10"))
    return shown


def test_it_shows_every_muscle_with_its_measured_length(
    arm: "Suite", terminal: PseudoTerminal
) -> None:
    muscles = arm.fresh_muscles()
    for name, length in zip(muscles.name, muscles.length, strict=True):
        assert float(terminal.row(name).split()[1]) == pytest.approx(length, abs=0.002)


def test_it_shows_the_rate_of_the_states(arm: "Suite", terminal: PseudoTerminal) -> None:
    arm.until("a rate", terminal.shows(" Hz, "))


def test_one_key_stops_the_arm_and_the_answer_is_shown(
    arm: "Suite", terminal: PseudoTerminal
) -> None:
    terminal.type("e")
    arm.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    arm.until("the answer", terminal.shows("done: all muscles at zero current"))
    arm.until("the banner", terminal.shows("EMERGENCY STOP: zero current until"))
    assert arm.reported("bridge", "emergency_stop") == "True"


def test_a_terminal_that_takes_nothing_does_not_delay_the_stop(
    arm: "Suite", terminal: PseudoTerminal
) -> None:
    terminal.freeze()
    arm.let_states_pass(3000)  # what is written meanwhile fills the terminal
    terminal.type("e")
    arm.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    terminal.send(signal.SIGTERM)
    assert terminal.wait(END_SEC) == 0


def test_clearing_needs_a_second_key(arm: "Suite", terminal: PseudoTerminal) -> None:
    terminal.type("e")
    arm.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    terminal.type("cx")
    arm.let_states_pass()
    assert set(arm.fresh_muscles().mode) == {MuscleState.MODE_ZERO_CURRENT}
    terminal.type("c")
    arm.until("the question", terminal.shows("y clears faults"))
    terminal.type("y")
    arm.wait_for_modes(MuscleState.MODE_LENGTH)


def test_hold_is_obeyed_and_answered(arm: "Suite", terminal: PseudoTerminal) -> None:
    held = arm.fresh_muscles().holds
    terminal.type("h")
    arm.until("a hold", lambda: arm.fresh_muscles().holds == held + 1)
    arm.until("the answer", terminal.shows("done: holding measured lengths"))


def test_the_home_key_holds_nothing(arm: "Suite", terminal: PseudoTerminal) -> None:
    held = arm.fresh_muscles().holds
    terminal.type("\x1b[H\x1bOH")
    arm.let_states_pass()
    assert arm.fresh_muscles().holds == held


@pytest.mark.parametrize("end", ["q", "\x03", signal.SIGINT, signal.SIGTERM], ids=repr)
def test_every_end_gives_the_terminal_back(
    terminal: PseudoTerminal, end: str | signal.Signals
) -> None:
    assert terminal.screen.alternate
    if isinstance(end, signal.Signals):
        terminal.send(end)
    else:
        terminal.type(end)
    assert terminal.wait(END_SEC) == 0
    screen = terminal.screen
    assert (screen.alternate, screen.cursor) == (False, True)
    assert terminal.attributes() == terminal.before
    assert "Traceback" not in screen.written_after


def test_states_that_end_are_shown_as_stale(world: "Suite", opened: Opened) -> None:
    holding_arm(world)
    terminal = opened(world.domain)
    world.until("the muscles on the screen", lambda: " length" in terminal.row("#10"))
    world.processes["bridge"].send(signal.SIGKILL)
    world.until("stale rows", lambda: "stale" in terminal.row("#10"))
    world.until("a banner", terminal.shows("STALE: no state for"))
    terminal.type("e")
    world.until("no answer", terminal.shows("NO ANSWER yet"))


def test_a_missing_service_is_told(world: "Suite", opened: Opened) -> None:
    alone = opened(world.domain)
    world.until("the keys", alone.shows("e EMERGENCY STOP"))
    alone.type("e")
    world.until("the missing service", alone.shows("s ago, NOT SENT: no such service"))


def test_it_shows_the_arm_of_its_namespace(tmp_path: Path, world: "Suite", opened: Opened) -> None:
    nodes = []
    for name in ("mock_driver", "bridge"):
        parameters = {"bus_url": world.bus_url}
        own = isolated_environment(world.domain)
        log = tmp_path / f"left_{name}.log"
        arguments = ["-r", "__ns:=/left"]
        nodes.append(Process("musashi_muscle_bridge", name, parameters, own, log, arguments))
    try:
        left = opened(world.domain, "-r", "__ns:=/left")
        world.until("the left arm", lambda: left.row("#10") != "")
        world.until("its namespace", left.shows("fastswing  /left"))
        world.until("its bridge", left.shows("bridge"))
    finally:
        stop_all(nodes)


def test_without_colours_it_shows_the_same_words(opened: Opened, world: "Suite") -> None:
    plain = opened(world.domain, NO_COLOR="1")
    world.until("the keys", plain.shows("e EMERGENCY STOP"))
    world.until("a banner", plain.shows("NO STATE YET"))
    assert not plain.screen.coloured


@pytest.mark.parametrize(
    ("term", "reason"), [("xterm", "standard input is no terminal"), ("dumb", "TERM is 'dumb'")]
)
def test_without_a_usable_terminal_it_ends_with_2_and_one_line(term: str, reason: str) -> None:
    inner, outer = os.openpty()
    run = subprocess.run(
        [str(executable(*MONITOR))],
        env={**isolated_environment(free_domain()), "TERM": term},
        stdin=outer if term == "dumb" else subprocess.DEVNULL,
        stdout=outer,
        stderr=subprocess.PIPE,
        text=True,
        timeout=END_SEC,
        check=False,
    )
    os.close(inner)
    os.close(outer)
    (line,) = run.stderr.splitlines()
    assert run.returncode == 2
    assert reason in line
