"""docs/on_the_robot.md explains every verdict, and tunes parameters that exist."""

import re

import pytest
from followed_page import DOCS
from parameter_page import declared_tables

from musashi_muscle_bridge.calibration import PullSettings, Verdict

TEXT = (DOCS / "on_the_robot.md").read_text()


@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_has_its_row(verdict: Verdict) -> None:
    assert re.search(rf"^\| `{verdict.name.lower()}` \|", TEXT, re.MULTILINE)


def test_the_pull_is_as_strong_and_as_far_as_the_page_says() -> None:
    assert f"grows by {PullSettings.current_step:g} A" in TEXT
    assert f"more than {1e3 * PullSettings.most_travel:g} mm" in TEXT


def test_every_threshold_to_tune_is_a_parameter() -> None:
    tuning = TEXT[TEXT.index("## Tuning the thresholds") :]
    changes = [line.split("|")[2] for line in tuning.splitlines() if line.startswith("| ")][1:]
    names = {row.name for table in declared_tables() for row in table.rows}
    for change in changes:
        named = set(re.findall(r"`(\w+)`", change))
        assert named
        assert named <= names, change
