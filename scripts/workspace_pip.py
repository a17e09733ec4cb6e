"""Runs pip in the environment: a few lines of progress, one line of reason when it fails."""

from __future__ import annotations

import shutil
import time

import workspace_common as common
from workspace_common import ROOT, VENV, WorkspaceError, say

LOG = ROOT / "setup.log"
TEMPORARY = VENV / "tmp"
REPORT_PERIOD_SEC = 10.0
OFFLINE_SIGNS = (
    "from versions: none",
    "connection broken",
    "Could not fetch URL",
    "ReadTimeoutError",
    "ConnectTimeout",
    "ProxyError",
    "Max retries exceeded",
)


class PipReport:
    """Keeps pip's output in a log and tells its progress now and then."""

    def __init__(self) -> None:
        """Start with an empty log."""
        self.started = self.reported = time.monotonic()
        self.collected = 0
        self.lines: list[str] = []
        LOG.write_text("", encoding="utf-8")

    def line(self, text: str) -> None:
        """Take one line of pip's output."""
        self.lines.append(text)
        with LOG.open("a", encoding="utf-8") as log:
            log.write(text + "\n")
        self.collected += text.startswith("Collecting ")
        if text.startswith("Installing collected packages") and self.collected > 1:
            self._say(f"installing {self.collected} packages")
        elif (
            text.startswith("Collecting ") and time.monotonic() - self.reported > REPORT_PERIOD_SEC
        ):
            self._say(f"{self.collected} packages found")

    def _is_due(self) -> bool:
        return time.monotonic() - self.reported > REPORT_PERIOD_SEC

    def _say(self, text: str) -> None:
        self.reported = time.monotonic()
        say(f"set-up:   {text} ({self.reported - self.started:.0f} s)")

    def trouble(self) -> str:
        """Return in one line why pip failed and what to do."""
        output = "\n".join(self.lines)
        if "No space left on device" in output:
            return "the disk is full; about 2 GB are needed"
        if any(sign in output for sign in OFFLINE_SIGNS):
            return (
                "packages cannot be downloaded: the package index is not reachable; "
                "check the network (or proxy, or pip's configuration) and run this again"
            )
        errors = [line for line in self.lines if "ERROR" in line] or self.lines or ["no output"]
        return f"pip failed ({errors[-1].strip()}); its whole output is in {LOG.name}"


def _pip_environment() -> dict[str, str]:
    environment = common.clean_environment()
    # What a killed pip leaves behind goes when the environment is made anew.
    environment["TMPDIR"] = str(TEMPORARY)
    environment.update(PIP_USER="0", PIP_NO_INPUT="1", PIP_DISABLE_PIP_VERSION_CHECK="1")
    environment.setdefault("PIP_RETRIES", "3")
    return environment


def pip_install(lock: int, *arguments: str) -> None:
    """Run pip install in the environment; raise in one line why it failed."""
    TEMPORARY.mkdir(exist_ok=True)
    report = PipReport()
    pip = [str(VENV / "bin" / "python"), "-m", "pip", "install", "--progress-bar", "off"]
    if common.run_child([*pip, *arguments], lock, _pip_environment(), report.line):
        raise WorkspaceError(report.trouble())
    shutil.rmtree(TEMPORARY, ignore_errors=True)
