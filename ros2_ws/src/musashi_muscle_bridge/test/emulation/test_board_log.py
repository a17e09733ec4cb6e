"""The log of the boards tells what they were told and what they did."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fastswing_planner.errors import InvalidParameter
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import COMMAND_ROW, CommandFrame, Mode, WatchdogAction
from musashi_muscle_bridge.emulation.board_log import BoardLog
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.bus import Served

TIMEOUT = 0.1


@pytest.fixture
def frame() -> CommandFrame:
    rows = np.zeros(2, COMMAND_ROW)
    rows["id"] = 0, 1
    rows["mode"] = Mode.TENSION, Mode.ZERO_CURRENT
    rows["setpoint"] = 12.5, 0.0
    rows["tension_limit"], rows["current_limit"] = 60.0, 8.0
    return CommandFrame(7, rows, WatchdogAction.ZERO_CURRENT, TIMEOUT, session=3)


@pytest.fixture
def boards(hoist: Robot) -> Boards:
    return Boards(hoist)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "boards.tsv"


@pytest.fixture
def log(path: Path) -> Iterator[BoardLog]:
    log = BoardLog(str(path))
    yield log
    log.close()


def lines(path: Path, kind: str) -> list[list[str]]:
    cells = [line.split("\t") for line in path.read_text().splitlines()]
    return [line[1:] for line in cells if line[0] == kind]


def test_a_question_without_rows_is_no_command(
    log: BoardLog, path: Path, boards: Boards, frame: CommandFrame
) -> None:
    question = dataclasses.replace(frame, rows=np.zeros(0, COMMAND_ROW))
    log.command(4.25, 0, question, boards)
    log.command(4.5, 0, frame, boards)
    assert [line[0] for line in lines(path, "command")] == ["4.500000"]


def test_a_command_is_noted_with_time_setpoints_and_limit(
    log: BoardLog, path: Path, boards: Boards, frame: CommandFrame
) -> None:
    boards.handle(frame)
    log.command(4.25, 0, frame, boards)
    ((*told, tension),) = lines(path, "command")
    assert told == ["4.250000", "0", "3", "7", "20", "12.50000,0.00000", "60.000", "20", "00"]
    assert float(tension) >= 0.0


def test_an_answer_is_noted_with_its_commands_arrival(log: BoardLog, path: Path) -> None:
    log.answer(4.5, 0, Served(7, arrived=4.25, measured=4.375))
    assert lines(path, "answer") == [["4.500000", "0", "7", "4.250000", "4.375000"]]


def test_boards_that_do_not_change_are_noted_once(
    log: BoardLog, path: Path, boards: Boards
) -> None:
    log.changes(1.0, boards)
    log.changes(2.0, boards)
    assert len(lines(path, "boards")) == 1


def test_a_watchdog_is_noted_with_the_boards_own_time_since_the_command(
    log: BoardLog, path: Path, boards: Boards, frame: CommandFrame
) -> None:
    boards.handle(frame)
    boards.advance(0.5)
    log.changes(9.0, boards)
    ((time, modes, faults, silence, _),) = lines(path, "boards")
    assert (time, modes, faults) == ("9.000000", "00", "55")
    assert TIMEOUT <= float(silence) <= TIMEOUT + 2 * boards.plant.time_step


def test_an_existing_file_is_not_overwritten(path: Path) -> None:
    path.write_text("precious")
    with pytest.raises(InvalidParameter, match="board_log: "):
        BoardLog(str(path))
    assert path.read_text() == "precious"
