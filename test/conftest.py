"""The suite's nodes for tests across packages, alone or together."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from lifecycle_msgs.msg import State
from processes import free_domain, isolated_environment

from test.system.suite import TIMEOUT_FORGIVEN_SEC, Suite


@pytest.fixture(scope="session", autouse=True)
def _only_this_machine() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for key, value in isolated_environment(free_domain()).items():
            if os.environ.get(key) != value:
                patch.setenv(key, value)
        yield


@pytest.fixture
def world(tmp_path: Path) -> Iterator[Suite]:
    """No node yet."""
    suite = Suite(tmp_path)
    yield suite
    suite.close()


@pytest.fixture(scope="module")
def new_suite(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Suite]:
    """No node yet, for a whole module; afterwards every node has ended with 0."""
    suite = Suite(tmp_path_factory.mktemp("suite"))
    try:
        yield suite
    finally:
        codes = suite.close()
    assert set(codes.values()) <= {0}, codes


@pytest.fixture(scope="module")
def bridge_and_mock(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Suite]:
    """Start the bridge and the mock's boards and arm."""
    suite = Suite(tmp_path_factory.mktemp("bridge_and_mock"))
    try:
        suite.start_active("mock_driver", "bridge")
        suite.hold()
        yield suite
    finally:
        suite.close()


@pytest.fixture(scope="module")
def lone_planner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Suite]:
    """Start the planner alone."""
    suite = Suite(tmp_path_factory.mktemp("lone_planner"))
    try:
        suite.start_active("planner")
        assert suite.plan().error_string == ""
        yield suite
    finally:
        suite.close()


@pytest.fixture(scope="module")
def all_nodes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Suite]:
    """Start everything that a swing needs."""
    suite = Suite(tmp_path_factory.mktemp("all_nodes"))
    try:
        # A shared machine stalls; the defaults' own time-outs are tried where nothing swings.
        suite.start("bridge", watchdog_timeout=TIMEOUT_FORGIVEN_SEC)
        suite.start("swing_executor", state_timeout=TIMEOUT_FORGIVEN_SEC)
        suite.start("inhibitor", state_timeout=TIMEOUT_FORGIVEN_SEC, lease=0.2)
        suite.start_active("mock_driver", "planner")
        for name in ("bridge", "swing_executor", "inhibitor"):
            suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        suite.hold()
        suite.wait_until_swings_are_judged()
        suite.until(
            "the executor's length_command",
            lambda: suite.node.count_publishers("length_command") == 1,
        )
        yield suite
    finally:
        suite.close()
