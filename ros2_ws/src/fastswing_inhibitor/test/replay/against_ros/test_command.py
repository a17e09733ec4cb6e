"""The command: a verification can fail for any arm, a what-if cannot."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from decided_swing import ARM, LIMITS, straight, write

from fastswing_inhibitor.replay import command as replay_command


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let every description be that of the bent arm; return the names of those loaded."""
    names: list[str] = []

    def load(uri: str) -> Any:
        names.append(Path(uri).name)
        return SimpleNamespace(model=ARM, limits=LIMITS)

    monkeypatch.setattr(replay_command, "load_robot", load)
    return names


def spoilt(folder: Path) -> str:
    """Write a bag in which one override is missing."""

    def lose(number: int, topic: str, message: Any) -> Any:
        return None if (number, topic) == (7, "/current_override") else message

    return str(write(folder / "a.mcap", straight(), lose))


def test_a_difference_fails_the_verification_of_any_robot(
    tmp_path: Path, loaded: list[str]
) -> None:
    assert replay_command.main([spoilt(tmp_path), "--robot", "/other.yaml"]) == 1
    assert loaded == ["other.yaml"]


def test_a_difference_is_the_answer_of_a_what_if(tmp_path: Path, loaded: list[str]) -> None:
    assert replay_command.main([spoilt(tmp_path), "--model", "/other.yaml"]) == 0
    assert loaded == ["other.yaml"]


@pytest.mark.parametrize(
    ("option", "value", "changed", "same"),
    [
        ("--threshold", "0.5", "C 0.5 s/rad", 17),
        ("--velocity-limit", "0.1", "velocity limit 0.1 m/s", 0),
    ],
)
def test_a_what_if_with_another_number_tells_how_many_decisions_stay(
    tmp_path: Path,
    loaded: list[str],
    capsys: pytest.CaptureFixture[str],
    option: str,
    value: str,
    changed: str,
    same: int,
) -> None:
    path = write(tmp_path / "a.mcap", straight())
    assert replay_command.main([str(path), "--robot", "/other.yaml", option, value]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        f"what if: {changed}",
        f"swing 1 at 0.000 s, C 0 s/rad: 20 decisions, {same} as published",
    ]


def test_a_bag_that_agrees_passes(tmp_path: Path, loaded: list[str]) -> None:
    path = write(tmp_path / "a.mcap", straight())
    assert replay_command.main([str(path), "--robot", "/other.yaml"]) == 0


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        (
            "--threshold",
            "1e300",
            "threshold is 1e+300 s/rad, must be 0 to 1e+06: below 0 agonists would be inhibited",
        ),
        ("--threshold", "nan", "threshold is nan, expected a finite number"),
        (
            "--velocity-limit",
            "0",
            "velocity_limit of #1 is 0 m/s, must be positive",
        ),
        (
            "--velocity-limit",
            "1e300",
            "velocity_limit of #1 is 1e+300 m/s, must be 0.0001 to 1000",
        ),
    ],
)
def test_a_what_if_that_no_arm_could_have_is_refused(
    capsys: pytest.CaptureFixture[str], option: str, value: str, expected: str
) -> None:
    assert replay_command.main(["any.mcap", option, value]) == 2
    assert capsys.readouterr().err == f"replay: {expected}\n"
