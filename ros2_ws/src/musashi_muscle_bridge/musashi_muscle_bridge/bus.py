"""How frames travel to the boards."""

from importlib.metadata import entry_points
from typing import Protocol
from urllib.parse import urlsplit

from musashi_muscle_bridge.errors import BusError

ENTRY_POINT_GROUP = "musashi_muscle_bridge.buses"


class Bus(Protocol):
    """The bridge's end of a bus to one group of boards."""

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError."""

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s], BusError otherwise."""

    def close(self) -> None:
        """Release the port."""


def open_bus(url: str) -> Bus:
    """Open the bus that a URL such as `udp://127.0.0.1:48800` names.

    The scheme selects an entry point of the group `musashi_muscle_bridge.buses`, a callable that
    takes the URL. Raises BusError naming the URL and the schemes there are.
    """
    scheme = urlsplit(url).scheme
    buses = {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}
    if scheme not in buses:
        raise BusError(
            f"bus_url '{url}': unknown scheme '{scheme}', choose from: {', '.join(sorted(buses))}"
        )
    bus: Bus = buses[scheme].load()(url)
    return bus
