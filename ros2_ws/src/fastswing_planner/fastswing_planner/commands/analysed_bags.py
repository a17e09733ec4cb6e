"""The bags that `analyse` is given, and what is found in each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.findings import BagFindings, examine
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.reading import read_recordings
from fastswing_planner.bags import BagError, open_bag


@dataclass(frozen=True)
class AnalysedBags:
    """findings by bag, and what could not be read, a line each."""

    by_bag: dict[Path, BagFindings]
    errors: list[str]

    @property
    def findings(self) -> list[BagFindings]:
        """What was found in each bag."""
        return list(self.by_bag.values())

    def swings_of(self, paths: Sequence[Path]) -> list[MeasuredSwing]:
        """Return the swings in some of the bags."""
        found = [self.by_bag[path] for path in paths if path in self.by_bag]
        return [swing for one in found for swing in one.swings]

    @property
    def swings(self) -> list[MeasuredSwing]:
        """The swings of all bags."""
        return self.swings_of(list(self.by_bag))


def analyse_bags(
    paths: Sequence[Path], settings: FindingSettings, tolerance: float
) -> AnalysedBags:
    """Read and measure each bag; tolerance [rad] from the end posture counts as arrived."""
    by_bag: dict[Path, BagFindings] = {}
    errors = []
    for path, name in zip(paths, short_names(paths), strict=True):
        try:
            bag = open_bag(path)
            recordings = read_recordings(name, bag, settings)
            lines = bag.warnings
        except BagError as error:
            errors.append(" ".join(str(error).split()))
            continue
        by_bag[path] = examine(name, recordings, settings, tolerance, lines)
    return AnalysedBags(by_bag, errors)


def short_names(paths: Sequence[Path]) -> list[str]:
    """Return the last part of each path, or more where that is not enough to tell them apart."""
    whole = [path.absolute().parts for path in paths]
    depth = 1
    while len({parts[-depth:] for parts in whole}) < len(set(whole)):
        depth += 1
    return ["/".join(parts[-depth:]) for parts in whole]


def bags_of_group(path: Path) -> list[Path]:
    """Return the bags of one side of a comparison: a bag, or all bags in a folder."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return [path]
    inside = sorted(
        one
        for one in path.iterdir()
        if one.suffix == ".mcap" or (one.is_dir() and (one / "metadata.yaml").exists())
    )
    return inside or [path]
