"""The table of faults: how each is made, at which phase, what is safe, what is seen, what helps."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import injections as make
from bench import HOLD, NODES, PHASES, Bench

Action = Callable[[Bench], object]


class Safe(Enum):
    """What counts as safe after a fault; the value is the page's word for it."""

    HELD = "every muscle driven, its commanded length constant"
    HELD_BUT_ONE = "the muscle concerned without current, all others held"
    WATCHDOG = "every board in its watchdog action"
    NO_CURRENT = "no board drives its motor"
    SWUNG = "the swing goes on to its end, and is held there"
    UNCHANGED = "the arm is held as before"
    GONE = "the emulated boards themselves are gone, as without power"
    EITHER = "held, or every board in its watchdog action"


@dataclass(frozen=True)
class Step:
    """One thing that an operator does."""

    text: str
    act: Action


@dataclass(frozen=True)
class Row:
    """One fault.

    phase    where the swing by Method 1 is; "hold": the arm is held, nothing swings
    sees     (place, pattern) of what an operator sees, see `Bench.sees`; all of them
    muscle   index of the muscle concerned, for HELD_BUT_ONE
    timing   measured many times
    prepare  what comes before; returns whether it brought the swing to its phase as well
    quick    part of `make test`; the others only of `make faults`
    """

    group: str
    fault: str
    phase: str
    inject: Action
    safe: Safe
    sees: Sequence[tuple[str, str]]
    recover: Sequence[Step] = ()
    muscle: int | None = None
    timing: bool = False
    quick: bool = True
    prepare: Callable[[Bench], bool] | None = None

    @property
    def name(self) -> str:
        """One word for the test's id."""
        words = f"{self.fault} {self.phase}".lower()
        return "".join(c if c.isalnum() else "_" for c in words).strip("_").replace("__", "_")


CLEAR = Step("support the arm, `clear_faults`", make.clear)
_STOPPED = "STALE_STATE|FAULT_LATCHED|NOT_READY"
_FAILED = "^(?!SUCCESS)"
_NOT_ANSWERING = ("bridge", "do not answer|latched until clear_faults")
_WATCHDOGS = ("mock_driver.faulty_boards", "^10$")


def _start(node: str) -> Step:
    what = "the boards have power again" if node == "mock_driver" else f"start `{node}` again"
    return Step(what, lambda bench: bench.restart(node))


def _go_on(node: str) -> Step:
    return Step(f"let `{node}` go on (SIGCONT)", lambda bench: bench.go_on(node))


def _process_row(node: str, phase: str, signal_number: signal.Signals) -> Row:
    kill = signal_number is signal.SIGKILL
    back = (_start if kill else _go_on)(node)
    swinging = phase != HOLD
    sees: list[tuple[str, str]] = []
    recover = [back]
    if node == "mock_driver":
        safe = Safe.GONE
        sees.append(_NOT_ANSWERING)
        if swinging:
            sees.append(("result", _STOPPED))
        recover.append(CLEAR)
    elif node == "bridge":
        safe = Safe.WATCHDOG
        sees.append(_WATCHDOGS)
        if swinging:
            sees.append(("result", _STOPPED))
        recover.append(CLEAR)
    else:
        sees.append((f"{node} silent", "."))
        if not swinging:
            safe = Safe.UNCHANGED
        elif node == "swing_executor":
            safe = Safe.HELD
        elif node == "planner" or phase == "recover":
            safe = Safe.SWUNG
        else:
            safe = Safe.HELD
            silent = "has been silent" if phase == "swing" else _FAILED
            sees.append(("result", silent))
    return Row(
        "Processes",
        f"{signal_number.name} of {node}",
        phase,
        lambda bench: make.end_or_stop(bench, node, signal_number),
        safe,
        sees,
        recover,
        timing=node in ("bridge", "inhibitor", "swing_executor") and phase == "swing",
        quick=phase == "swing" or (node in ("bridge", "swing_executor") and phase == "raise"),
    )


def _restart_row(node: str) -> Row:
    safe = {
        "mock_driver": Safe.NO_CURRENT,
        "bridge": Safe.NO_CURRENT,
        "planner": Safe.SWUNG,
    }.get(node, Safe.HELD)
    sees = {
        "mock_driver": [("bridge", "boards started again")],
        "bridge": [("result", _STOPPED)],
        "swing_executor": [("result", "CANCELED: the node was deactivated")],
        "inhibitor": [("result", _FAILED)],
    }.get(node, [])
    return Row(
        "Processes",
        f"restart of {node} (SIGINT, start)",
        "swing",
        lambda bench: make.end_and_restart(bench, node),
        safe,
        sees,
        [CLEAR] if node in ("mock_driver", "bridge") else [],
        quick=False,
    )


def _control_row(signal_number: signal.Signals, word: str) -> Row:
    return Row(
        "Processes",
        f"{signal_number.name} of the bridge's control process",
        "swing",
        lambda bench: make.end_or_stop_control(bench, signal_number),
        Safe.WATCHDOG,
        [("bridge", f"the control process {word}"), _WATCHDOGS, ("result", _STOPPED)],
        [Step("restart `bridge`", lambda bench: make.end_and_restart(bench, "bridge")), CLEAR],
        timing=True,
    )


def _mend(what: str, **values: object) -> Step:
    return Step(what, lambda bench: bench.line(**values))


def _line(**values: object) -> Action:
    return lambda bench: bench.line(**values)


PROCESS_ROWS = [
    _process_row(node, phase, signal_number)
    for signal_number in (signal.SIGKILL, signal.SIGSTOP)
    for node in NODES
    for phase in (HOLD, *PHASES[1:])
]

BUS_ROWS = [
    Row(
        "Bus and boards",
        "bus dead",
        phase,
        _line(loss=1.0),
        Safe.WATCHDOG,
        [_NOT_ANSWERING, _WATCHDOGS, *([("result", _STOPPED)] if phase != HOLD else [])],
        [_mend("connect the bus", loss=0.0), CLEAR],
        timing=phase == "swing",
        quick=phase == "swing",
    )
    for phase in (HOLD, "raise", "swing")
]
BUS_ROWS += [
    Row(
        "Bus and boards",
        "board of #1 dead",
        phase,
        _line(dead_board=["#1"]),
        Safe.HELD_BUT_ONE,
        [("bridge", "latched until clear_faults: #1"), *result],
        [_mend("give it power", dead_board=[]), CLEAR],
        muscle=0,
        timing=phase == "swing",
        quick=phase == "swing",
    )
    for phase, result in (
        (HOLD, []),
        ("raise", [("result", "FAULT_LATCHED")]),
        ("swing", [("result", "FAULT_LATCHED")]),
    )
]
BUS_ROWS += [
    Row(
        "Bus and boards",
        "encoder of #6 stuck",
        "raise",
        _line(stuck_encoder=["#6"]),
        Safe.HELD_BUT_ONE,
        [("bridge", "latched until clear_faults: #6"), ("result", "FAULT_LATCHED")],
        [_mend("replace the encoder", stuck_encoder=[]), CLEAR],
        muscle=5,
        timing=True,
    ),
    Row(
        "Bus and boards",
        "encoder of #9 stuck",
        HOLD,
        _line(stuck_encoder=["#9"]),
        Safe.UNCHANGED,
        [],
        [_mend("replace the encoder", stuck_encoder=[]), CLEAR],
        quick=False,
    ),
    Row(
        "Bus and boards",
        "1% of frames corrupted",
        "raise",
        _line(corruption=0.01),
        Safe.SWUNG,
        [("mock_driver.refused_damaged", "[1-9]"), ("bridge.dropped_damaged", "[1-9]")],
        [_mend("mend the bus", corruption=0.0)],
    ),
    Row(
        "Bus and boards",
        "100% of frames corrupted",
        "swing",
        _line(corruption=1.0),
        Safe.WATCHDOG,
        [_NOT_ANSWERING, ("mock_driver.refused_damaged", "[1-9]"), ("result", _STOPPED)],
        [_mend("mend the bus", corruption=0.0), CLEAR],
        timing=True,
    ),
    Row(
        "Bus and boards",
        "answers 20 ms late",
        "raise",
        _line(latency=0.02),
        Safe.SWUNG,
        [("bridge.worst_round_trip_ms", "[0-9]"), ("bridge.misses", "[0-9]")],
        [_mend("mend the bus", latency=0.0)],
    ),
]

_WITH_BOARDS_THAT_HOLD = "with `watchdog_action` hold_length: "
HOLD_LENGTH_ROWS = [
    Row(
        "Bus and boards",
        _WITH_BOARDS_THAT_HOLD + "SIGKILL of bridge",
        "swing",
        lambda bench: make.end_or_stop(bench, "bridge", signal.SIGKILL),
        Safe.WATCHDOG,
        [_WATCHDOGS, ("result", _STOPPED)],
        [_start("bridge"), CLEAR],
        quick=False,
        prepare=make.boards_that_hold,
    ),
    Row(
        "Bus and boards",
        _WITH_BOARDS_THAT_HOLD + "bus dead",
        "swing",
        _line(loss=1.0),
        Safe.WATCHDOG,
        [_NOT_ANSWERING, _WATCHDOGS, ("result", _STOPPED)],
        [_mend("connect the bus", loss=0.0), CLEAR],
        quick=False,
        prepare=make.boards_that_hold,
    ),
]

MESSAGE_ROWS = [
    Row(
        "Messages",
        "joint states with NaN from a second publisher",
        "swing",
        make.foreign_joint_states(make.not_a_number),
        Safe.SWUNG,
        [("inhibitor", "rejected.*nan"), ("swing_executor", "rejected.*nan")],
    ),
    Row(
        "Messages",
        "absurd joint states (100 rad) from a second publisher",
        "swing",
        make.foreign_joint_states(make.absurd),
        Safe.HELD,
        [("inhibitor.last_end", "moved farther"), ("result", _FAILED)],
    ),
    Row(
        "Messages",
        "muscle states with NaN from a second publisher",
        "swing",
        make.muscle_states_of_nan,
        Safe.SWUNG,
        [("swing_executor", "rejected.*nan")],
        quick=False,
    ),
    Row(
        "Messages",
        "joint states with unknown joints",
        "swing",
        make.foreign_joint_states(make.renamed),
        Safe.SWUNG,
        [("inhibitor", "is missing in")],
        quick=False,
    ),
    Row(
        "Messages",
        "joint states in another order, each value with its name",
        "swing",
        make.foreign_joint_states(make.reordered),
        Safe.SWUNG,
        [],
    ),
    Row(
        "Messages",
        "joint states with the names in wrong order",
        "swing",
        make.foreign_joint_states(make.misnamed),
        Safe.HELD,
        [("inhibitor.last_end", "moved farther"), ("result", _FAILED)],
    ),
    Row(
        "Messages",
        "length commands with NaN",
        HOLD,
        make.length_commands(float("nan")),
        Safe.UNCHANGED,
        [
            ("bridge", "two publishers|is nan"),
            ("bridge.rejected_length_command_not_finite", "[1-9]"),
        ],
    ),
    Row(
        "Messages",
        "tension commands of 1e6 N",
        HOLD,
        make.tension_commands,
        Safe.HELD,
        [("bridge.clamped", "[1-9]")],
        [Step("end the publisher: the muscle holds after `command_timeout`", make.end_extra)],
    ),
    Row(
        "Messages",
        "current commands of 1e6 A",
        HOLD,
        make.current_commands(1e6, 0.5),
        Safe.HELD,
        [("bridge.clamped", "[1-9]")],
        [Step("end the publisher: the muscle holds after `command_timeout`", make.end_extra)],
    ),
    Row(
        "Messages",
        "current commands of -1e6 A",
        HOLD,
        make.current_commands(-1e6, 0.5),
        Safe.HELD,
        [("bridge.clamped", "[1-9]")],
        [Step("end the publisher: the muscle holds after `command_timeout`", make.end_extra)],
        quick=False,
    ),
    Row(
        "Messages",
        "second publisher of length_command",
        HOLD,
        make.second_publisher,
        Safe.UNCHANGED,
        [("bridge", "two publishers on length_command")],
        [Step("end one of the two", make.end_extra)],
    ),
    Row(
        "Messages",
        "length commands with QoS best effort",
        HOLD,
        make.best_effort_commands,
        Safe.UNCHANGED,
        [("bridge log", "incompatible QoS")],
        [Step("publish with QoS reliable", make.end_extra)],
    ),
    Row(
        "Messages",
        "inhibitor armed twice",
        "swing",
        make.arm_again,
        Safe.SWUNG,
        [],
    ),
]

TIME_ROWS = [
    Row(
        "Time",
        f"clock jumps one hour {way}",
        "swing",
        make.jump(seconds),
        Safe.HELD,
        [],
        prepare=make.on_simulated_time,
    )
    for way, seconds in (("ahead", 3600.0), ("back", -3600.0))
]
TIME_ROWS += [
    Row(
        "Time",
        "use_sim_time of all nodes without a clock",
        HOLD,
        make.no_clock,
        Safe.HELD,
        [("result", "STALE_REQUEST")],
        [Step("set `use_sim_time` to false, or start the clock", make.real_time)],
        prepare=make.fresh_nodes,
    ),
    Row(
        "Time",
        "the clock of use_sim_time stops",
        "swing",
        make.stop_clock,
        Safe.SWUNG,
        [],
        prepare=make.on_simulated_time,
    ),
]

MACHINE_ROWS = [
    Row(
        "Machine",
        "task code killed and started again",
        "swing",
        make.kill_task_code,
        Safe.SWUNG,
        [("swing_executor.ended_success", "[1-9]")],
        prepare=make.swing_by_task_code,
    ),
    Row(
        "Machine",
        "two busy processes",
        "raise",
        make.burn,
        Safe.EITHER,
        [("result", ".")],
        [Step("end them", make.end_extra), CLEAR],
        timing=True,
    ),
    Row(
        "Machine",
        "disk full while recording",
        "raise",
        make.fill_disk,
        Safe.SWUNG,
        [("recorder", "No space left|not be written|space")],
        [Step("make room, start the recorder again", make.end_extra)],
    ),
    Row(
        "Machine",
        "SIGKILL of record",
        "raise",
        make.kill_recorder,
        Safe.SWUNG,
        [("recorder silent", ".")],
        quick=False,
    ),
]

ROWS = [
    *PROCESS_ROWS,
    _control_row(signal.SIGKILL, "died"),
    _control_row(signal.SIGSTOP, "stands still"),
    *[_restart_row(node) for node in NODES],
    *BUS_ROWS,
    *HOLD_LENGTH_ROWS,
    *MESSAGE_ROWS,
    *TIME_ROWS,
    *MACHINE_ROWS,
]
