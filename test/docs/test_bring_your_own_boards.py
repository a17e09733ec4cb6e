"""docs/bring_your_own_boards.md keeps its word; the bus itself is tried by test_bus_contract.py."""

from importlib.metadata import entry_points
from pathlib import Path

import pytest
from lab_bus_page import PAGE, install_lab_bus

from musashi_muscle_bridge.buses.bus import BOARD_ENDS, BRIDGE_ENDS


def test_the_example_has_about_60_lines() -> None:
    assert len(PAGE.files["lab_bus/lab_bus.py"].splitlines()) <= 65


def test_the_package_registers_both_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(install_lab_bus(tmp_path)))
    for group in (BRIDGE_ENDS, BOARD_ENDS):
        assert "lab" in entry_points(group=group).names
