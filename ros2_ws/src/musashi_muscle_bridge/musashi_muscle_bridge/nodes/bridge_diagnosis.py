"""What the bridge's diagnostics say, and what is news for its log."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from musashi_muscle_bridge.buses.protocol import Fault
from musashi_muscle_bridge.control.command_intake import CommandTally
from musashi_muscle_bridge.control.loop import LoopStatus, Measurement
from musashi_muscle_bridge.control.period import slack
from musashi_muscle_bridge.nodes.state_messages import reported_faults

# Longer than the control process takes to start on a busy machine.
_LASTING_SILENCE_SEC = 3.0
_FAULTS = "faults, latched until clear_faults: {}"
_FAULT_NAMES = {fault.value: fault.name.lower() for fault in Fault}


@dataclass(frozen=True)
class BridgeCondition:
    """What the bridge knows of itself at one moment.

    status       the control process's last
    standstill   why it takes no orders; empty if it does
    unpublished  states that were measured and not published
    failures     states that could not be published
    measured     the newest measurement
    contested    command topics with more than one publisher
    tally        of commands
    """

    status: LoopStatus
    standstill: str
    unpublished: int
    failures: int
    measured: Measurement | None
    contested: Sequence[str]
    tally: CommandTally


class BridgeDiagnosis:
    """Reports of one robot on its buses."""

    def __init__(self, muscle_names: Sequence[str], urls: Sequence[str], read_only: bool) -> None:
        """Name m muscles, and the buses by position."""
        self._names = muscle_names
        self._urls = urls
        self._read_only = read_only
        self._told_faults = ""
        self._silent_since: dict[int, float] = {}
        self._told_silent: tuple[int, ...] = ()

    # For the diagnostics.

    def report(self, condition: BridgeCondition) -> tuple[bytes, str, dict[str, object]]:
        """Return level (DiagnosticStatus), summary and values."""
        status, report = condition.status, condition.status.report
        values: dict[str, object] = {
            "read_only": self._read_only,
            "emergency_stop": report.emergency,
            "overridden": self._named(report.overridden),
            "clamped": report.clamped,
            "outdated": report.outdated,
            "latched": self._named(report.latched),
            "rebooted": self._named(report.rebooted),
            "lost": self._named(report.lost),
            **self._told_by_boards(condition.measured),
            **status.statistics,
            "unpublished_states": condition.unpublished,
            **condition.tally.counts,
        }
        for problem, level, text in self._problems(condition, values):
            if problem:
                return level, text, values
        return DiagnosticStatus.OK, "read only" if self._read_only else "ok", values

    def _told_by_boards(self, measured: Measurement | None) -> dict[str, object]:
        if measured is None:
            return {"faults": "", "slack": "", "refused_by_boards": 0}
        return {
            "faults": self._fault_text(measured),
            "slack": self._named(slack(measured.state)),
            "refused_by_boards": int(measured.state.rows["refused"].max(initial=0)),
        }

    def _problems(
        self, condition: BridgeCondition, values: Mapping[str, object]
    ) -> Iterator[tuple[object, bytes, str]]:
        """Yield what can be wrong, the worst first: whether it is, its level and its text."""
        silent = condition.status.silent
        where = f" on {', '.join(self._urls[n] for n in silent)}" if len(self._urls) > 1 else ""
        error, warning = DiagnosticStatus.ERROR, DiagnosticStatus.WARN
        yield condition.standstill, error, condition.standstill
        # What they latch meanwhile follows from it.
        yield silent, error, f"the boards do not answer{where}"
        for key, text in (
            ("rebooted", "boards started again, at zero current until clear_faults: {}"),
            ("faults", _FAULTS),
            ("latched", "latched until clear_faults: {}"),
            ("emergency_stop", "emergency stop, see clear_faults"),
        ):
            yield values[key], error, text.format(values[key])
        yield condition.failures, error, "states cannot be published, see the log"
        contested = condition.contested
        yield contested, error, f"two publishers on {', '.join(contested)}"
        yield values["slack"], warning, f"slack in tension mode: {values['slack']}"
        yield condition.tally.last, warning, f"rejected {condition.tally.last}"

    # For the log.

    def fault_news(self, measured: Measurement) -> str:
        """Return the faults; empty if there is none, or none other than at the last call."""
        text = self._fault_text(measured)
        news = _FAULTS.format(text) if text and text != self._told_faults else ""
        self._told_faults = text
        return news

    def silence_news(self, silent: tuple[int, ...], now: float) -> tuple[str, bool]:
        """Return what is new of buses that do not answer, and whether that is good news.

        silent  buses that do not answer now, by position
        now     monotonic time [s]

        Empty while nothing is new; a short pause never is.
        """
        self._silent_since = {bus: self._silent_since.get(bus, now) for bus in silent}
        lasting = tuple(
            bus for bus, since in self._silent_since.items() if now - since > _LASTING_SILENCE_SEC
        )
        if set(lasting) - set(self._told_silent):
            self._told_silent = lasting
            urls = ", ".join(self._urls[bus] for bus in lasting)
            return f"the boards do not answer on {urls}", False
        if self._told_silent and not silent:
            self._told_silent = ()
            return "the boards answer again", True
        return "", False

    # Texts.

    def _fault_text(self, measured: Measurement) -> str:
        return ", ".join(
            f"{name} {_FAULT_NAMES.get(number, f'fault {number}')}"
            for name, number in zip(self._names, reported_faults(measured).tolist(), strict=True)
            if number
        )

    def _named(self, chosen: NDArray[np.bool_]) -> str:
        return ", ".join(self._names[index] for index in np.flatnonzero(chosen).tolist())
