"""Carries out one row of the table, and tells what came out."""

import re
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pytest
from bench import ARRIVAL_TOLERANCE, HOLD, NODES, Bench, Disturbed
from board_lines import CURRENT, LENGTH, TENSION, WATCHDOG, ZERO
from fault_rows import Row, Safe

from fastswing_planner.execution.settings import ExecutionSettings
from musashi_muscle_bridge.control.command_limits import command_limits

ATTEMPTS = 8
STALL_SEC = 0.08
"""Of the watchdog's 0.1 s, less what a frame may be under way."""
SILENCE_SEC = ExecutionSettings().state_timeout
PERIOD_SEC = 0.002
_STALLED = ("STALE_STATE", "FAULT_LATCHED", "joint states stopped", "PHASE_TIMEOUT")
_PAUSE_STATES = 1000
_ROUNDING = 2e-4  # of the wire's 32-bit numbers and of the log


@dataclass
class Outcome:
    """What came out of a fault; times [s] after its injection.

    safe_after              None where nothing is there to measure
    seen                    what an operator saw, text by place
    result, result_after    of the swing, before and after the recovery
    peak_tension            [N] measured, the largest of all muscles
    beyond_limits           commands beyond the robot's limits
    frames_without_current  command frames in a row that went on letting muscles go
    let_go_sec              from the injection to the last frame that let a muscle go
    silence                 [s] the boards' own time from the last command to their watchdog
    recovered               whether all muscles hold without faults in the end
    killed_by_hand          nodes that had to be killed
    disturbed               attempts before in which the machine stalled, by what came of it
    """

    row: str
    safe_after: float | None = None
    seen: dict[str, str] = field(default_factory=dict)
    result: str = ""
    result_after: str = ""
    peak_tension: float = 0.0
    beyond_limits: list[str] = field(default_factory=list)
    frames_without_current: int = 0
    let_go_sec: float | None = None
    silence: float | None = None
    recovered: bool = False
    recovery_sec: float = 0.0
    killed_by_hand: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    disturbed: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Return it for a JSON file."""
        return asdict(self)


def carry_out(bench: Bench, row: Row) -> Outcome:
    """Carry out a row; an attempt that a stall of this machine disturbed is repeated."""
    disturbed: list[str] = []
    while True:
        try:
            outcome = _attempt(bench, row, again=len(disturbed) > 0)
        except Disturbed as stall:
            disturbed.append(str(stall))
            if len(disturbed) >= ATTEMPTS:
                raise
        else:
            outcome.disturbed = disturbed
            return outcome


def _attempt(bench: Bench, row: Row, again: bool) -> Outcome:
    bench.tidy()
    if again:
        # A node that was started again may not have been found by all others yet.
        bench.suite.let_states_pass(_PAUSE_STATES)
    on_the_way = row.prepare is not None and row.prepare(bench)
    if row.phase != HOLD and not on_the_way:
        bench.swing_to(row.phase)
    if row.safe is Safe.UNCHANGED:
        now = time.monotonic()
        bench.suite.until("the arm to be held", lambda: bench.lines.held_since(now) is not None)
    bench.suite.diagnostics.clear()
    outcome = Outcome(row.name)
    lines = bench.lines  # the fault may end the boards, and their log
    there = bench.swing is not None and bench.swing.distance_to_end < 2.0 * ARRIVAL_TOLERANCE
    start = time.monotonic()
    row.inject(bench)
    lines.poll()
    if row.phase == "swing" and (there or not lines.letting_go(start)):
        raise Disturbed("the fault came too late: the arm was there")
    outcome.safe_after = _wait_until_safe(bench, row, start)
    outcome.seen = _wait_until_seen(bench, row, start)
    _judge(bench, outcome, start)
    _recover(bench, row, outcome)
    return outcome


def _wait_until_safe(bench: Bench, row: Row, start: float) -> float | None:
    reached: list[float] = []
    if row.safe is Safe.GONE:
        return None

    def safe() -> bool:
        _refuse_stall(bench, row, start)
        at = _SAFE[row.safe](bench, row, start)
        if at is not None:
            reached.append(at)
        return at is not None

    bench.suite.until(f"the arm to be safe: {row.safe.value}", safe)
    if row.safe in (Safe.SWUNG, Safe.UNCHANGED):
        return None
    return max(reached[0] - start, 0.0)


def _held(bench: Bench, row: Row, start: float) -> float | None:
    return bench.lines.held_since(start)


def _held_but_one(bench: Bench, row: Row, start: float) -> float | None:
    assert row.muscle is not None
    return bench.lines.held_since(start, without=frozenset({row.muscle}))


def _swung(bench: Bench, row: Row, start: float) -> float | None:
    swing = bench.swing
    if swing is not None and not swing.ended:
        return None
    if swing is not None and swing.result != "SUCCESS":
        raise Disturbed(f"the swing ended with {swing.result}")
    return bench.lines.held_since(start)


def _unchanged(bench: Bench, row: Row, start: float) -> float | None:
    at = bench.lines.held_since(start)
    assert at is None or at <= start, f"the commands changed {at - start:.3f} s after the fault"
    return at


def _either(bench: Bench, row: Row, start: float) -> float | None:
    if bench.swing is not None and not bench.swing.ended:
        return None
    watchdog = bench.lines.in_watchdog_since(start)
    return bench.lines.held_since(start) if watchdog is None else watchdog


_SAFE: dict[Safe, Callable[[Bench, Row, float], float | None]] = {
    Safe.HELD: _held,
    Safe.HELD_BUT_ONE: _held_but_one,
    Safe.WATCHDOG: lambda bench, row, start: bench.lines.in_watchdog_since(start),
    Safe.NO_CURRENT: lambda bench, row, start: bench.lines.without_current_since(start),
    Safe.SWUNG: _swung,
    Safe.UNCHANGED: _unchanged,
    Safe.EITHER: _either,
}


def _refuse_stall(bench: Bench, row: Row, start: float) -> None:
    """Raise Disturbed if the boards' watchdog acted where the fault does not explain it."""
    if row.safe in (Safe.WATCHDOG, Safe.NO_CURRENT, Safe.GONE, Safe.EITHER):
        return
    latched = [
        {fault for muscle, fault in enumerate(line.faults) if muscle != row.muscle}
        for line in bench.lines.commands[-1:]
    ]
    if bench.lines.in_watchdog_since(start) is not None or latched == [{WATCHDOG}]:
        _raise_if_stalled(bench, "the boards' watchdog acted")


def _raise_if_stalled(bench: Bench, what: str) -> None:
    """Raise Disturbed if commands were late by a watchdog's time; else fail: it is the nodes'."""
    gap = bench.lines.longest_gap(bench.tidied_at)
    if gap < STALL_SEC:
        pytest.fail(f"{what}, but commands came at least every {gap:.3f} s")
    raise Disturbed(f"the machine stalled: {what}")


def _refuse_success(bench: Bench, row: Row, start: float) -> None:
    """Fail where a swing that a silence should have ended arrived; earlier it is Disturbed."""
    expected = dict(row.sees).get("result", "SUCCESS")
    if bench.swing is None or bench.swing.result != "SUCCESS" or re.search(expected, "SUCCESS"):
        return
    # Without an inhibitor an arm may arrive before anybody misses it. Without states nobody may
    # call a swing a success, unless its result was on its way already.
    of_inhibitor = re.search("of inhibitor", row.fault) is not None
    after = (bench.swing.arrived_at if of_inhibitor else bench.swing.ended_at) - start
    if after < SILENCE_SEC:
        raise Disturbed(f"the swing succeeded {after:.3f} s after the fault, before it was missed")
    pytest.fail(f"the swing went on to its end and succeeded {after:.3f} s after the fault")


def _wait_until_seen(bench: Bench, row: Row, start: float) -> dict[str, str]:
    seen: dict[str, str] = {}

    def all_seen() -> bool:
        _refuse_success(bench, row, start)
        for place, pattern in row.sees:
            text = bench.sees(place, pattern)
            if text:
                seen.setdefault(place, text)
        return len(seen) == len({place for place, _ in row.sees})

    try:
        bench.suite.until(f"an operator to see {row.sees}", all_seen)
    except pytest.fail.Exception as error:
        swing = bench.swing and (bench.swing.result or bench.swing.phases[-1:])
        pytest.fail(f"{error}\nswing: {swing}; seen: {seen}")
    return seen


def _judge(bench: Bench, outcome: Outcome, start: float) -> None:
    lines = bench.lines
    commands = lines.commands_since(start)
    outcome.result = "" if bench.swing is None else bench.swing.result
    outcome.notes = list(bench.notes)
    outcome.frames_without_current = lines.frames_without_current(start, PERIOD_SEC)
    last_let_go = [line.time for line in commands if ZERO in line.modes][-1:]
    outcome.let_go_sec = last_let_go[0] - start if last_let_go else None
    outcome.silence = lines.silence_of_watchdog(start)
    tensions = [line.tension for line in commands]
    tensions += [line.tension for line in lines.boards if line.time >= start]
    outcome.peak_tension = max(tensions, default=0.0)
    if not commands:
        return
    robot = bench.suite.robot
    limits = command_limits(robot, 0.1, 0.2, 0.2)
    modes = np.array([list(line.modes) for line in commands])
    values = np.array([line.setpoints for line in commands])
    low, high = limits.length_min - _ROUNDING, limits.length_max + _ROUNDING
    wrong = {
        "tension": (modes == TENSION) & ~((values >= 0.0) & (values <= limits.tension_max)),
        "current": (modes == CURRENT) & ~((values >= 0.0) & (values <= limits.current_max)),
        "length": (modes == LENGTH) & ~((values >= low) & (values <= high)),
    }
    for kind, where in wrong.items():
        for frame, muscle in np.argwhere(where)[:3]:
            outcome.beyond_limits.append(
                f"{kind} of {robot.model.muscle_names[muscle]}: {values[frame, muscle]:g}"
            )
    over = max(line.tension_limit for line in commands)
    if over > robot.tension_limit.max() + _ROUNDING:
        outcome.beyond_limits.append(f"tension limit of the boards: {over:g}")


def _recover(bench: Bench, row: Row, outcome: Outcome) -> None:
    started = time.monotonic()
    for step in row.recover:
        step.act(bench)
    bench.suite.refuse_dead()
    swing = bench.swing
    bench.wait_for_idle()
    outcome.result_after = "" if swing is None else swing.result
    bench.suite.until("the boards to answer", lambda: _sound(bench))
    outcome.recovered = True
    outcome.recovery_sec = time.monotonic() - started
    outcome.killed_by_hand = [name for name in NODES if not bench.suite.processes[name].running]


def _sound(bench: Bench) -> bool:
    lines = bench.lines
    if not lines.commands or lines.commands[-1].time < time.monotonic() - 1.0:
        return False
    last = lines.commands[-1]
    if set(last.faults) == {WATCHDOG}:
        _raise_if_stalled(bench, "the boards' watchdog acted after the recovery")
    return set(last.modes) == {LENGTH} and set(last.faults) == {"0"}
