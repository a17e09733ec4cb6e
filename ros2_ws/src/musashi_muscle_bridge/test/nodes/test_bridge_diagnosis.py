"""The bridge's diagnostics: the worst comes first; the log is told what is new, once."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from musashi_muscle_bridge.buses.protocol import JOINT_ROW, STATE_ROW, Fault, Mode, StateFrame
from musashi_muscle_bridge.control.command_intake import CommandTally
from musashi_muscle_bridge.control.loop import LoopStatus, Measurement
from musashi_muscle_bridge.control.period import ControlReport
from musashi_muscle_bridge.errors import CommandRejected
from musashi_muscle_bridge.nodes.bridge_diagnosis import BridgeCondition, BridgeDiagnosis

MUSCLES = ("#1", "#9")
URLS = ("udp://one", "udp://two")
NONE, ALL = np.zeros(2, dtype=bool), np.ones(2, dtype=bool)
REPORT = ControlReport(
    emergency=False,
    overridden=NONE,
    latched=NONE,
    rebooted=NONE,
    lost=NONE,
    clamped=0,
    outdated=0,
)


def status(silent: tuple[int, ...] = (), **report: Any) -> LoopStatus:
    return LoopStatus(0.0, REPORT._replace(**report), {"rate": 500.0}, silent)


def measured(fault: Fault = Fault.NONE, mode: Mode = Mode.LENGTH) -> Measurement:
    """Return what both boards tell."""
    rows = np.zeros(2, STATE_ROW)
    rows["fault"], rows["mode"], rows["tension"] = fault, mode, 20.0
    return Measurement(StateFrame(1, rows, np.zeros(0, JOINT_ROW)), NONE, True, 0.0)


def condition(**changes: Any) -> BridgeCondition:
    fine = BridgeCondition(status(), "", 0, 0, measured(), [], CommandTally())
    return replace(fine, **changes)


def diagnosis(urls: tuple[str, ...] = URLS, read_only: bool = False) -> BridgeDiagnosis:
    return BridgeDiagnosis(MUSCLES, urls, read_only)


def rejecting() -> CommandTally:
    tally = CommandTally()
    tally.reject("length_command", CommandRejected("not_finite", "the value of #1 is nan"))
    return tally


PROBLEMS: list[tuple[dict[str, Any], str]] = [
    ({"standstill": "the control process died"}, "the control process died"),
    ({"status": status(silent=(1,))}, "the boards do not answer on udp://two"),
    (
        {"status": status(rebooted=ALL)},
        "boards started again, at zero current until clear_faults: #1, #9",
    ),
    (
        {"measured": measured(Fault.WATCHDOG)},
        "faults, latched until clear_faults: #1 watchdog, #9 watchdog",
    ),
    ({"status": status(latched=ALL)}, "latched until clear_faults: #1, #9"),
    ({"status": status(emergency=True)}, "emergency stop, see clear_faults"),
    ({"failures": 1}, "states cannot be published, see the log"),
    ({"contested": ["length_command"]}, "two publishers on length_command"),
    ({"tally": rejecting()}, "rejected length_command: the value of #1 is nan"),
]


def test_a_bridge_with_nothing_wrong_is_ok() -> None:
    level, text, values = diagnosis().report(condition())
    assert (level, text) == (DiagnosticStatus.OK, "ok")
    assert values["rate"] == 500.0


def test_a_read_only_bridge_says_so() -> None:
    assert diagnosis(read_only=True).report(condition())[1] == "read only"


@pytest.mark.parametrize(("changes", "text"), PROBLEMS, ids=[text for _, text in PROBLEMS])
def test_a_problem_is_told(changes: dict[str, Any], text: str) -> None:
    level, told, _ = diagnosis().report(condition(**changes))
    expected = DiagnosticStatus.WARN if "rejected" in text else DiagnosticStatus.ERROR
    assert (level, told) == (expected, text)


def test_what_stops_everything_is_told_before_what_follows_from_it() -> None:
    everything: dict[str, Any] = {}
    for changes, _ in reversed(PROBLEMS):
        everything |= changes
    assert diagnosis().report(condition(**everything))[1] == "the control process died"


def test_the_only_bus_is_not_named() -> None:
    text = diagnosis(("udp://one",)).report(condition(status=status(silent=(0,))))[1]
    assert text == "the boards do not answer"


def test_before_the_first_measurement_nothing_is_told_of_the_boards() -> None:
    values = diagnosis().report(condition(measured=None))[2]
    assert (values["faults"], values["slack"], values["refused_by_boards"]) == ("", "", 0)


def test_counts_of_commands_stand_among_the_values() -> None:
    values = diagnosis().report(condition(tally=rejecting()))[2]
    assert values["rejected_length_command_not_finite"] == 1


def test_a_fault_is_news_once() -> None:
    log = diagnosis()
    news = "faults, latched until clear_faults: #1 watchdog, #9 watchdog"
    assert [log.fault_news(measured(Fault.WATCHDOG)) for _ in range(2)] == [news, ""]


def test_a_fault_that_comes_again_is_news_again() -> None:
    log = diagnosis()
    told = [bool(log.fault_news(measured(f))) for f in (Fault.WATCHDOG, Fault.NONE, Fault.WATCHDOG)]
    assert told == [True, False, True]


def test_a_short_silence_is_no_news() -> None:
    log = diagnosis()
    assert [log.silence_news((0,), now) for now in (0.0, 2.9)] == [("", False)] * 2
    assert log.silence_news((), 2.95) == ("", False)


def test_a_lasting_silence_and_its_end_are_news_once_each() -> None:
    log = diagnosis()
    told = [log.silence_news((1,), now) for now in (0.0, 3.1, 4.0)]
    assert told == [("", False), ("the boards do not answer on udp://two", False), ("", False)]
    assert [log.silence_news((), now) for now in (5.0, 6.0)] == [
        ("the boards answer again", True),
        ("", False),
    ]


def test_another_bus_that_falls_silent_is_news_too() -> None:
    log = diagnosis()
    log.silence_news((0,), 0.0)
    log.silence_news((0, 1), 3.1)
    assert log.silence_news((0, 1), 6.3) == (
        "the boards do not answer on udp://one, udp://two",
        False,
    )
