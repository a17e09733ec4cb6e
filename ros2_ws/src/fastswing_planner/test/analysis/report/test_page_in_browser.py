"""The page in a real browser: headless Chromium, spoken to through its debugging pipe."""

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.findings import BagFindings, examine
from fastswing_planner.analysis.motor_limits import MotorLimit
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.analysis.report.page import page
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.verdicts.checks import CheckResult
from fastswing_planner.analysis.verdicts.comparison import Comparison, compare

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
TELEPHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
DESK = {"width": 1400, "height": 900, "deviceScaleFactor": 1, "mobile": False}
SWINGS = 4
FIGURES = 3 * SWINGS + 3
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-pipe",
)

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium: apt-get install chromium to test the page in a browser"
)


class Browser:
    """One tab; remembers every event."""

    def __init__(self, folder: Path) -> None:
        """Start Chromium with a profile of its own in `folder`."""
        to_browser, self._commands = os.pipe()
        self._answers, from_browser = os.pipe()
        # Chromium reads commands from file descriptor 3 and answers on 4.
        redirect = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            [
                *("nice", "-n", "10", "bash", "-c", redirect, "bash", str(CHROMIUM)),
                *OPTIONS,
                f"--user-data-dir={folder}",
                "about:blank",
            ],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._buffer = b""
        self._count = 0
        self._session = ""
        self.events: list[dict[str, Any]] = []
        targets = self.ask("Target.getTargets")["targetInfos"]
        target = next(one["targetId"] for one in targets if one["type"] == "page")
        attached = self.ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result
            self.events.append(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            part = os.read(self._answers, 1 << 20)
            assert part, "Chromium ended"
            self._buffer += part
        line, _, self._buffer = self._buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        return message

    def open(self, path: Path) -> None:
        """Open a page and wait until it is complete."""
        self.events.clear()
        self.ask("Page.navigate", url=path.as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self._next())

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        result = self.ask("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def of(self, method: str) -> list[dict[str, Any]]:
        """Return the parameters of all events of a kind."""
        return [event["params"] for event in self.events if event.get("method") == method]

    def close(self) -> None:
        """End Chromium."""
        self._process.terminate()
        self._process.wait(timeout=30)
        os.close(self._commands)
        os.close(self._answers)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    started = Browser(tmp_path_factory.mktemp("chromium"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def report(recorded: Callable[..., Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a page with everything: notes, a violated check, a comparison, four swings."""

    def found(name: str) -> BagFindings:
        recording = replace(recorded(), source=f"{name} <i>&\"'.mcap")
        return examine(recording.source, [recording], FindingSettings(), lines=["a <b>line</b>"])

    findings = [found(f"run {number}") for number in range(SWINGS)]
    first, second = (
        [swing for one in half for swing in one.swings] for half in (findings[:2], findings)
    )
    limits = {name: MotorLimit(0.3, 200.0, 450.0) for name in ("#1", "#9", "#10")}
    result = CheckResult(("run 0 <u>: too slow",), 3)
    comparison = Comparison(("old", "new"), first, second, compare(first, second))
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page(Results(findings, limits, result, comparison)), encoding="utf-8")
    return path


@pytest.fixture
def opened(browser: Browser, report: Path) -> Browser:
    browser.ask("Emulation.setDeviceMetricsOverride", **DESK)
    browser.open(report)
    return browser


def test_nothing_is_complained_about(opened: Browser) -> None:
    complaints = [
        *opened.of("Runtime.exceptionThrown"),
        *(entry for entry in opened.of("Log.entryAdded") if entry["entry"]["level"] == "error"),
        *(call for call in opened.of("Runtime.consoleAPICalled") if call["type"] == "error"),
    ]
    assert complaints == []


def test_nothing_is_fetched_but_the_page_itself(opened: Browser) -> None:
    urls = [event["request"]["url"] for event in opened.of("Network.requestWillBeSent")]
    fetched = [url for url in urls if not url.startswith("data:")]
    assert len(fetched) == 1
    assert fetched[0].endswith("/report.html")
    assert fetched[0].startswith("file://")


@pytest.mark.parametrize("screen", [DESK, TELEPHONE], ids=["desk", "telephone"])
def test_every_figure_has_size_and_a_description(opened: Browser, screen: Any) -> None:
    opened.ask("Emulation.setDeviceMetricsOverride", **screen)
    figures = opened.evaluate(
        "[...document.images].map(image => [image.complete, image.naturalWidth, "
        "image.getBoundingClientRect().width, image.getBoundingClientRect().height, image.alt])"
    )
    assert len(figures) == FIGURES
    for complete, natural, width, height, description in figures:
        assert complete
        assert natural > 300
        assert width > 300
        assert height == pytest.approx(width * 3.5 / 4.8, rel=0.02)
        assert description


@pytest.mark.parametrize("width", [320, 390, 820, 1400])
def test_the_page_is_never_wider_than_the_screen(opened: Browser, width: int) -> None:
    opened.ask("Emulation.setDeviceMetricsOverride", **{**TELEPHONE, "width": width})
    assert opened.evaluate("document.documentElement.scrollWidth") <= width


def test_the_contents_lead_to_every_swing(opened: Browser) -> None:
    targets = opened.evaluate(
        "[...document.querySelectorAll('#contents a')].map("
        "link => document.getElementById(decodeURIComponent(link.hash.slice(1)))?.className)"
    )
    assert targets == ["swing"] * SWINGS


def test_names_from_the_bag_are_shown_as_they_are(opened: Browser) -> None:
    names = opened.evaluate(
        "[...document.querySelectorAll('#contents a')].map(one => one.textContent)"
    )
    assert names[0] == "run 0 <i>&\"'.mcap 1"
    assert opened.evaluate("document.querySelectorAll('a i, .notes b b, u').length") == 0


def test_what_is_beyond_a_limit_is_marked_by_more_than_colour(opened: Browser) -> None:
    marks = opened.evaluate("[...document.querySelectorAll('.mark')].map(one => one.textContent)")
    assert marks
    assert all(mark.startswith("▲") for mark in marks)
    verdict = opened.evaluate("document.querySelector('#check h2').textContent")
    assert verdict == "✗ Beyond limits"


def test_it_is_printed_with_each_swing_on_a_page_of_its_own(opened: Browser) -> None:
    printed = opened.ask("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
    pdf = base64.b64decode(printed["data"])
    assert pdf.startswith(b"%PDF")
    assert pdf.count(b"/Type /Page\n") >= SWINGS + 1
