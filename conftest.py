"""A second chance for tests that share this machine's cores with the processes they started."""

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let a system test be tried again once; the summary names those that needed it.

    With `--reruns 0` nothing is.
    """
    for item in items if config.getoption("reruns") != 0 else ():
        if item.get_closest_marker("system"):
            item.add_marker(pytest.mark.flaky(reruns=1, reruns_delay=2))
