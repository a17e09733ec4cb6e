"""Finds the swing in the bag of a demo."""

from collections.abc import Mapping
from pathlib import Path

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.findings import examine
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.reading import read_recordings
from fastswing_planner.bags import BagError, open_bag


class UnusableBag(ValueError):
    """A bag that holds no swing; the text names the file and what is missing."""


def read_swing(bag: Path) -> MeasuredSwing:
    """Return the fastest swing of a finished bag; raises UnusableBag."""
    settings = FindingSettings()
    try:
        findings = examine(bag.name, read_recordings(bag.name, open_bag(bag), settings), settings)
    except BagError as error:
        raise UnusableBag(f"{bag}: {error}") from error
    if not findings.swings:
        raise UnusableBag(f"{bag}: {'; '.join(findings.lines)}")
    return max(findings.swings, key=lambda swing: swing.main_joint.peak_speed)


def read_swings(bags: Mapping[str, Path]) -> dict[str, MeasuredSwing]:
    """Read the bags of several methods."""
    return {method: read_swing(bag) for method, bag in bags.items()}
