"""Starts installed executables as processes of their own, and ends them all."""

import ctypes
import os
import random
import signal
import socket
import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from ament_index_python.packages import get_package_prefix

_PR_SET_PDEATHSIG = 1
_ABORT_SEC = 5.0
_FIRST_PORT, _PORTS_PER_DOMAIN = 7400, 250


def executable(package: str, name: str) -> Path:
    """Return the file that `ros2 run PACKAGE NAME` would start."""
    return Path(get_package_prefix(package)) / "lib" / package / name


def free_domain() -> int:
    """Return a ROS domain id, 1 to 99, whose discovery port nobody on this machine uses."""
    candidates = random.SystemRandom().sample(range(1, 100), 99)
    for domain in candidates:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("0.0.0.0", _FIRST_PORT + _PORTS_PER_DOMAIN * domain))
            except OSError:
                continue
            return domain
    raise RuntimeError("every ROS domain from 1 to 99 is in use on this machine")


def free_udp_port() -> int:
    """Return a UDP port on loopback that nobody uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def isolated_environment(domain: int) -> dict[str, str]:
    """Return an environment whose nodes meet only each other, on this machine."""
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain),
        # LOCALHOST would bring shared memory with it: docs/safety.md.
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("loopback.xml")),
        "ROS_STATIC_PEERS": "",
        "RCUTILS_COLORIZED_OUTPUT": "0",
        "PYTHONUNBUFFERED": "1",
        "PYTHONFAULTHANDLER": "1",  # for `Process.wait`
    }


def _die_with_parent() -> None:
    # SIGTERM when the parent is gone, even by SIGKILL: no node is left behind.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


class Process:
    """One node, its log file and its clean end."""

    def __init__(
        self,
        package: str,
        name: str,
        parameters: Mapping[str, object],
        environment: Mapping[str, str],
        log: Path,
        ros_arguments: Sequence[str] = (),
        prefix: Sequence[str] = (),
        arguments: Sequence[str] = (),
    ) -> None:
        """Start `ros2 run PACKAGE NAME` with parameters, out of reach of the terminal's Ctrl-C.

        ros_arguments  more of what follows --ros-args, such as -r __ns:=/left
        prefix         a command that becomes the node, such as nsenter
        arguments      what stands before --ros-args
        """
        self.name = name
        self.log = log
        command = [*prefix, str(executable(package, name)), *arguments]
        if parameters or ros_arguments:
            command += ["--ros-args", *ros_arguments]
        for key, value in parameters.items():
            command += ["-p", f"{key}:={value}"]
        with log.open("w") as output:
            self._process = subprocess.Popen(
                command,
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_die_with_parent,
            )

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def send(self, signal_number: int) -> None:
        """Send a signal, if it still runs."""
        if self.running:
            self._process.send_signal(signal_number)

    def wait(self, timeout: float) -> int:
        """Return the exit code; abort the process after `timeout` [s]: its log says where it was.

        One that does not even die of that is killed.
        """
        try:
            return self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.send(signal.SIGABRT)
        try:
            return self._process.wait(_ABORT_SEC)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def log_tail(self, lines: int = 15) -> str:
        """Return the end of what it printed."""
        return "\n".join(self.log.read_text(errors="replace").splitlines()[-lines:])


def stop_all(processes: Sequence[Process], timeout: float = 10.0) -> dict[str, int]:
    """End processes with SIGINT, all at once; return the exit code of each by name."""
    for process in processes:
        process.send(signal.SIGINT)
    deadline = time.monotonic() + timeout
    return {
        process.name: process.wait(max(deadline - time.monotonic(), 0.1)) for process in processes
    }
