"""The dashboard's keys: from a terminal's bytes to what is asked for."""

from enum import Enum

QUIT = "quit"
CLEAR = "clear_faults"
SERVICES = {"e": "emergency_stop", "h": "hold_posture"}
"""Keys that ask for a service at once."""

_ESCAPE = 0x1B
_TORN_SEC = 0.5
_CONFIRM_SEC = 5.0


class _Within(Enum):
    NOTHING = 0
    ESCAPE = 1
    SEQUENCE = 2
    LAST_BYTE = 3


class KeyReader:
    """Finds typed letters, and leaves out what arrow and function keys send.

    These send an escape character and letters: the Home key ends with an H.
    """

    def __init__(self) -> None:
        self._within = _Within.NOTHING
        self._fed = 0.0

    def feed(self, data: bytes, now: float) -> list[str]:
        """Return the letters in what the terminal sent, in lower case.

        now  monotonic time [s]; a sequence that breaks off does not swallow a letter much later
        """
        if now - self._fed > _TORN_SEC:
            self._within = _Within.NOTHING
        self._fed = now
        return [chr(byte).lower() for byte in data if self._is_letter(byte)]

    def _is_letter(self, byte: int) -> bool:
        within = self._within
        if byte == _ESCAPE:
            self._within = _Within.ESCAPE
            return False
        if within is _Within.ESCAPE and byte in b"[O":
            self._within = _Within.SEQUENCE if byte == ord("[") else _Within.LAST_BYTE
            return False
        if within is _Within.SEQUENCE:
            if 0x40 <= byte <= 0x7E:
                self._within = _Within.NOTHING
            return False
        self._within = _Within.NOTHING
        return within is not _Within.LAST_BYTE and chr(byte).isascii() and chr(byte).isalpha()


class KeyPad:
    """Decides what a letter asks for: clearing faults needs a second one."""

    def __init__(self) -> None:
        self._asked_to_clear = -float("inf")

    def confirming(self, now: float) -> bool:
        """Whether `y` would clear faults at this monotonic time [s]."""
        return now - self._asked_to_clear <= _CONFIRM_SEC

    def press(self, letter: str, now: float) -> str:
        """Return the service that is asked for, QUIT, or an empty text."""
        confirmed = letter == "y" and self.confirming(now)
        self._asked_to_clear = now if letter == "c" else -float("inf")
        if confirmed:
            return CLEAR
        return QUIT if letter == "q" else SERVICES.get(letter, "")
