"""What became of the services that the dashboard asked for, in words."""

from dataclasses import dataclass


@dataclass(frozen=True)
class _Call:
    asked: float
    told: float
    outcome: str


class ServiceCalls:
    """The last call of each service; times are monotonic [s]."""

    def __init__(self) -> None:
        self._calls: dict[str, _Call] = {}

    def asked(self, service: str, now: float) -> None:
        """Note that a request was sent."""
        self._calls[service] = _Call(now, now, "")

    def missing(self, service: str, now: float) -> None:
        """Note that there was nobody to send a request to."""
        self._calls[service] = _Call(
            now, now, "NOT SENT: no such service; is the bridge active, and not read only?"
        )

    def answered(self, service: str, success: bool, text: str, now: float) -> None:
        """Note an answer."""
        asked = self._calls[service].asked if service in self._calls else now
        self._calls[service] = _Call(asked, now, f"{'done' if success else 'FAILED'}: {text}")

    def lines(self, now: float) -> list[str]:
        """Return a line for each service that was asked for, the last one first."""
        calls = sorted(self._calls.items(), key=lambda item: -item[1].asked)
        return [f"{service} {_ago(call, now)}" for service, call in calls]


def _ago(call: _Call, now: float) -> str:
    if call.outcome:
        return f"{now - call.told:.0f} s ago, {call.outcome}"
    return f"asked {now - call.asked:.0f} s ago, NO ANSWER yet"
