"""How frames travel between bridge and boards."""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from importlib.metadata import entry_points
from typing import Any, NamedTuple, Protocol, TypeVar
from urllib.parse import urlsplit

from musashi_muscle_bridge.errors import BusError

BRIDGE_ENDS = "musashi_muscle_bridge.buses"
BOARD_ENDS = "musashi_muscle_bridge.board_ports"

MAX_FRAME = 65507
"""[bytes] what one UDP datagram can carry; the answer of 74 muscles and 38 joints has 2,396."""


class Bus(Protocol):
    """The bridge's end of a bus to one group of boards.

    A bus carries whole frames and never keeps more than it can within one control period: what
    does not fit is lost, as on any bus. After an unplugging it finds its boards again by itself.
    """

    @property
    def dropped(self) -> Mapping[str, int]:
        """What was dropped, by reason, for the diagnostics; such as {"stranger": 3}."""

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError."""

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s], BusError otherwise."""

    def close(self) -> None:
        """Release the port."""


class _Closable(Protocol):
    def close(self) -> None: ...


class Received(NamedTuple):
    """A frame that came.

    sender   where it came from; None on a bus with a single bridge
    arrived  monotonic time [s] at which it reached this computer; NaN: the bus cannot tell
    """

    frame: bytes
    sender: Hashable
    arrived: float = math.nan


class BoardPort(Protocol):
    """The boards' end, for the mock driver; see Bus."""

    @property
    def dropped(self) -> Mapping[str, int]:
        """What was dropped, by reason."""

    def receive(self, timeout: float) -> Received | None:
        """Return the next frame, or None after `timeout` [s]; raises BusError."""

    def send(self, frame: bytes, to: Hashable) -> None:
        """Send a state frame to a sender; lost if it is gone."""

    def close(self) -> None:
        """Release the port."""


_End = TypeVar("_End", bound=_Closable)


def open_all(opener: Callable[[str], _End], urls: Sequence[str]) -> list[_End]:
    """Open one end of each bus, all of them or none; raises BusError."""
    opened: list[_End] = []
    try:
        for url in urls:
            opened.append(opener(url))
    except BaseException:
        for end in opened:
            end.close()
        raise
    return opened


def open_bus(url: str) -> Bus:
    """Open the bridge's end of the bus that a URL such as `udp://127.0.0.1:48800` names.

    The scheme selects an entry point of the group `musashi_muscle_bridge.buses`, a callable that
    takes the URL. Raises BusError naming the URL and the schemes there are.
    """
    bus: Bus = _opener(BRIDGE_ENDS, url)(url)
    return bus


def open_board_port(url: str) -> BoardPort:
    """Open the boards' end: the same with the group `musashi_muscle_bridge.board_ports`."""
    port: BoardPort = _opener(BOARD_ENDS, url)(url)
    return port


def group_urls(text: str, groups: int) -> list[str]:
    """Return the URL of each group's bus: the whole text for one, else separated by blanks.

    Raises BusError unless there are as many as groups, all different.
    """
    urls = [text] if groups == 1 else text.split()
    if len(urls) != groups:
        raise BusError(
            f"bus_url '{text}' has {len(urls)} URLs, the robot has {groups} board_groups: "
            "write one URL for each, separated by blanks"
        )
    for url in urls:
        if urls.count(url) > 1:
            raise BusError(f"bus_url '{text}': two board_groups cannot share {url}")
    return urls


def _opener(group: str, url: str) -> Callable[[str], Any]:
    scheme = url_scheme(url)
    openers = {entry.name: entry for entry in entry_points(group=group)}
    if scheme not in openers:
        choices = ", ".join(sorted(openers))
        raise BusError(f"bus_url '{url}': unknown scheme '{scheme}', choose from: {choices}")
    try:
        opener: Callable[[str], Any] = openers[scheme].load()
    except (ImportError, AttributeError) as error:
        raise BusError(
            f"bus_url '{url}': the entry point '{openers[scheme].value}' of {group} "
            f"cannot be loaded: {error}"
        ) from error
    return opener


def url_scheme(url: str) -> str:
    """Return what stands before `://`; raises BusError for what is no URL at all."""
    try:
        return urlsplit(url).scheme
    except ValueError as error:
        raise BusError(f"bus_url '{url}': {error}; expected SCHEME://...") from error
