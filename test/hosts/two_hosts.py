"""Two computers and a cable, out of network namespaces: the kernel removes them with us."""

import ctypes
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress

_PR_SET_PDEATHSIG = 1
_READY_SEC = 10.0
_INTERFACE = "eth0"
_LIBC = ctypes.CDLL(None)


class NotPossible(Exception):
    """This machine or kernel does not let us make network namespaces; the text says why."""


def _die_with_parent() -> None:
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


class Host:
    """A network namespace, alive as long as a process that sleeps in it."""

    def __init__(self) -> None:
        """Raise NotPossible where the kernel refuses."""
        self._sleeper = subprocess.Popen(
            ["unshare", "--net", "sleep", "infinity"],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=_die_with_parent,
        )
        self.pid = self._sleeper.pid
        self.network = f"/proc/{self.pid}/ns/net"
        self.prefix = ["nsenter", f"--net={self.network}"]
        try:
            self._wait()
            self.run("ip", "link", "set", "lo", "up")
        except BaseException:
            self.close()
            raise

    def _wait(self) -> None:
        ours = os.readlink("/proc/self/ns/net")
        deadline = time.monotonic() + _READY_SEC
        while time.monotonic() < deadline:
            if self._sleeper.poll() is not None:
                assert self._sleeper.stderr is not None
                raise NotPossible(self._sleeper.stderr.read().strip())
            with suppress(OSError):  # it may just have ended
                if os.readlink(self.network) != ours:
                    return
            time.sleep(0.01)
        raise NotPossible("unshare made no network namespace")

    def run(self, *command: str) -> str:
        """Run a command on this host; return what it prints."""
        return _run([*self.prefix, *command])

    def close(self) -> None:
        """Let the kernel remove the namespace and what is in it."""
        self._sleeper.kill()
        self._sleeper.wait()
        if self._sleeper.stderr is not None:
            self._sleeper.stderr.close()


def _run(command: Sequence[str]) -> str:
    run = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if run.returncode != 0:
        raise NotPossible(f"{' '.join(command)}: {run.stderr.strip()}")
    return run.stdout


class TwoHosts:
    """A robot's computer and a task's computer, with a cable between them."""

    def __init__(self) -> None:
        """Raise NotPossible, naming what is missing."""
        missing = [name for name in ("ip", "unshare", "nsenter") if shutil.which(name) is None]
        if missing:
            raise NotPossible(f"not installed: {', '.join(missing)}")
        self.robot = Host()
        try:
            self.task = Host()
        except BaseException:
            self.robot.close()
            raise
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        end = ["ip", "link", "add", _INTERFACE, "type", "veth", "peer", "name", _INTERFACE]
        self.robot.run(*end, "netns", str(self.task.pid))
        for number, host in enumerate((self.robot, self.task), start=1):
            host.run("ip", "address", "add", f"10.77.0.{number}/24", "dev", _INTERFACE)
            host.run("ip", "link", "set", _INTERFACE, "up")

    def cut(self) -> None:
        """Pull the cable."""
        self.robot.run("ip", "link", "set", _INTERFACE, "down")

    def heal(self) -> None:
        """Put the cable back."""
        self.robot.run("ip", "link", "set", _INTERFACE, "up")

    def close(self) -> None:
        """Remove both."""
        self.robot.close()
        self.task.close()
