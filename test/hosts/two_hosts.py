"""Two computers and a cable, out of network namespaces: the kernel removes them with us."""

import ctypes
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

_PR_SET_PDEATHSIG = 1
_CLONE_NEWNET = 0x40000000
_READY_SEC = 10.0
_INTERFACE = "eth0"
_LIBC = ctypes.CDLL(None, use_errno=True)
_GROUP = ("239.255.0.1", 7399)
"""The group in which DDS participants find each other (DDSI-RTPS 9.6.1.4), a port of no domain."""


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
        self.address = ""
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

    def socket(self) -> socket.socket:
        """Return a UDP socket on this host: it stays where its thread made it."""

        def make() -> socket.socket:
            with open(self.network) as network:
                if _LIBC.setns(network.fileno(), _CLONE_NEWNET) != 0:
                    raise NotPossible(f"setns: {os.strerror(ctypes.get_errno())}")
            return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

        with ThreadPoolExecutor(1) as elsewhere:
            return elsewhere.submit(make).result()

    def wait_until_up(self) -> None:
        """Wait until the kernel says that the interface runs: some time after it was set up.

        Fast DDS looks for running interfaces once, and would never use this one.
        """
        deadline = time.monotonic() + _READY_SEC
        while " state UP " not in self.run("ip", "-oneline", "link", "show", "dev", _INTERFACE):
            if time.monotonic() > deadline:
                raise NotPossible(f"{_INTERFACE} does not come up")
            time.sleep(0.01)

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


def _try_multicast(sender: Host, receiver: Host) -> None:
    """Raise NotPossible if what one host tells a group does not reach the other."""
    with sender.socket() as out, receiver.socket() as into:
        into.bind(_GROUP)
        group = socket.inet_aton(_GROUP[0]) + socket.inet_aton(receiver.address)
        into.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        into.settimeout(0.1)
        here = socket.inet_aton(sender.address)
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, here)
        deadline = time.monotonic() + _READY_SEC
        while time.monotonic() < deadline:
            out.sendto(b"here", _GROUP)
            with suppress(TimeoutError):
                into.recv(16)
                return
        raise NotPossible(f"{receiver.address} hears no multicast from {sender.address}")


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
            host.address = f"10.77.0.{number}"
            host.run("ip", "address", "add", f"{host.address}/24", "dev", _INTERFACE)
            host.run("ip", "link", "set", _INTERFACE, "up")
        for host in (self.robot, self.task):
            host.wait_until_up()
        for sender, receiver in ((self.robot, self.task), (self.task, self.robot)):
            _try_multicast(sender, receiver)

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
