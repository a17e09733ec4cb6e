"""Finds the swings in bags and measures them.

ros2 run fastswing_planner analyse BAG... [--output FOLDER] [--check LIMITS.yaml] [--json]
ros2 run fastswing_planner analyse --compare A B [--output FOLDER]
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.findings import BagFindings, examine
from fastswing_planner.analysis.measured_swing import MeasuredSwing, swing_label
from fastswing_planner.analysis.motor_limits import MotorLimits, motor_limits
from fastswing_planner.analysis.reading import read_recordings
from fastswing_planner.analysis.report.comparison_drawing import comparison_pictures
from fastswing_planner.analysis.report.drawing_style import joint_styles, muscle_styles
from fastswing_planner.analysis.report.page import page
from fastswing_planner.analysis.report.record import findings_record
from fastswing_planner.analysis.report.swing_drawing import save_swing
from fastswing_planner.analysis.report.text import check_text, comparison_text, findings_text
from fastswing_planner.analysis.verdicts.checks import CheckResult, check
from fastswing_planner.analysis.verdicts.comparison import Difference, compare
from fastswing_planner.analysis.verdicts.criteria import Criteria, CriteriaError, read_criteria
from fastswing_planner.bags.reader import BagError, open_bag
from fastswing_planner.command_line import say
from fastswing_planner.errors import InvalidLimit, RobotDescriptionError
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

_Comparison = tuple[Sequence[Difference], dict[str, bytes]]
_DEFAULTS = FindingSettings()
PAGE_NAME = "report.html"
RECORD_NAME = "analysis.json"

PASSED, VIOLATED, UNUSABLE = 0, 1, 2
"""Exit codes: fine; a limit was violated; a bag, file or argument cannot be used."""


@dataclass(frozen=True)
class _Found:
    """findings by bag, and what could not be read, a line each."""

    by_bag: dict[Path, BagFindings]
    errors: list[str]

    @property
    def findings(self) -> list[BagFindings]:
        return list(self.by_bag.values())

    def of(self, paths: Sequence[Path]) -> list[BagFindings]:
        return [self.by_bag[path] for path in paths if path in self.by_bag]

    @property
    def swings(self) -> list[MeasuredSwing]:
        return [swing for one in self.findings for swing in one.swings]


def _examine_bags(paths: Sequence[Path], settings: FindingSettings, tolerance: float) -> _Found:
    by_bag: dict[Path, BagFindings] = {}
    errors = []
    names = _short_names(paths)
    for path, name in zip(paths, names, strict=True):
        try:
            bag = open_bag(path)
            recordings = read_recordings(name, bag, settings)
            lines = bag.warnings
        except BagError as error:
            errors.append(" ".join(str(error).split()))
            continue
        by_bag[path] = examine(name, recordings, settings, tolerance, lines)
    return _Found(by_bag, errors)


def _short_names(paths: Sequence[Path]) -> list[str]:
    """Return the last part of each path, or more where that is not enough to tell them apart."""
    whole = [path.absolute().parts for path in paths]
    depth = 1
    while len({parts[-depth:] for parts in whole}) < len(set(whole)):
        depth += 1
    return ["/".join(parts[-depth:]) for parts in whole]


def _group(path: Path) -> list[Path]:
    """Return the bags of one side of a comparison: a bag, or all bags in a folder."""
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return [path]
    inside = sorted(
        one
        for one in path.iterdir()
        if one.suffix == ".mcap" or (one.is_dir() and (one / "metadata.yaml").exists())
    )
    return inside or [path]


def _limits_of_robot(argument: str | None) -> tuple[MotorLimits, str]:
    """Return the motors' limits, and why they are not known."""
    try:
        return motor_limits(load_robot(argument or MUSASHI)), ""
    except RobotDescriptionError as error:
        if argument is not None:
            raise
        return {}, f"speed limits are not known: {error}"


def _write(
    output: Path,
    found: Sequence[BagFindings],
    limits: MotorLimits,
    formats: Sequence[str],
    result: CheckResult | None,
    comparison: _Comparison | None,
    groups: tuple[str, str],
) -> list[Path]:
    """Write page, record and pictures; raises OSError."""
    output.mkdir(parents=True, exist_ok=True)
    written = [output / PAGE_NAME, output / RECORD_NAME]
    text = page(found, limits, result, comparison, groups)
    written[0].write_text(text, encoding="utf-8")
    differences = comparison[0] if comparison is not None else ()
    record = findings_record(found, limits, result, differences)
    written[1].write_text(_json(record) + "\n", encoding="utf-8")
    swings = [swing for one in found for swing in one.swings]
    joints, muscles = joint_styles(swings), muscle_styles(swings)
    for number, swing in enumerate(swings, 1):
        for suffix in formats:
            path = output / f"swing_{number:03d}_{swing.method.replace(' ', '_')}.{suffix}"
            save_swing(path, swing, joints, muscles, limits, swing_label(swing))
            written.append(path)
    return written


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="analyse",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="exit code 0: fine, 1: a limit of --check was violated, 2: something cannot be used",
    )
    parser.add_argument(
        "bags", nargs="*", type=Path, metavar="BAG", help=".mcap file or bag folder"
    )
    parser.add_argument(
        "--compare",
        nargs=2,
        type=Path,
        metavar=("A", "B"),
        help="two bags, or two folders of bags, side by side",
    )
    parser.add_argument("--check", type=Path, metavar="LIMITS.yaml", help="limits to pass or fail")
    parser.add_argument("--output", type=Path, help=f"folder for {PAGE_NAME} and pictures")
    parser.add_argument(
        "--formats",
        nargs="*",
        choices=("png", "svg"),
        default=["png"],
        help="of the pictures beside the page (png)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument(
        "--robot", help="YAML file of the robot, for its limits; package:// works too"
    )
    parser.add_argument(
        "--swing-speed",
        type=float,
        default=_DEFAULTS.swing_speed,
        help="[rad/s] a motion with a faster joint is a swing (%(default)s)",
    )
    parser.add_argument(
        "--rest-speed",
        type=float,
        default=_DEFAULTS.rest_speed,
        help="[rad/s] an arm rests while no joint is faster (%(default)s)",
    )
    parser.add_argument(
        "--rest-time",
        type=float,
        default=_DEFAULTS.rest_time,
        help="[s] a rest between two swings is at least as long (%(default)s)",
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.1,
        help="[rad] norm of the distance to the end that counts as arrived (%(default)s)",
    )
    return parser


def _settings(arguments: argparse.Namespace) -> FindingSettings:
    if not arguments.tolerance > 0.0:
        raise InvalidLimit(f"tolerance is {arguments.tolerance:g} rad, must be positive")
    return FindingSettings(arguments.swing_speed, arguments.rest_speed, arguments.rest_time)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, 1 for violated limits, 2 if something cannot be used."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    if not arguments.bags and not arguments.compare:
        parser.error("name a bag, or two with --compare")
    if arguments.bags and arguments.compare:
        parser.error("--compare takes both bags: analyse --compare A B")
    try:
        settings = _settings(arguments)
        wanted = None if arguments.check is None else read_criteria(arguments.check)
        limits, unknown = _limits_of_robot(arguments.robot)
    except (InvalidLimit, CriteriaError, RobotDescriptionError) as error:
        print(f"analyse: {error}", file=sys.stderr)
        return UNUSABLE
    return _run(arguments, settings, wanted, limits, unknown)


def _run(
    arguments: argparse.Namespace,
    settings: FindingSettings,
    wanted: Criteria | None,
    limits: MotorLimits,
    unknown: str,
) -> int:
    comparison: _Comparison | None = None
    groups = ("A", "B")
    tolerance: float = arguments.tolerance
    if arguments.compare:
        sides = [_group(path) for path in arguments.compare]
        found = _examine_bags([*sides[0], *sides[1]], settings, tolerance)
        names = _short_names(arguments.compare)
        groups = (names[0], names[1])
        read = [[swing for one in found.of(side) for swing in one.swings] for side in sides]
        comparison = (compare(*read), comparison_pictures(*read) if arguments.output else {})
    else:
        found = _examine_bags(arguments.bags, settings, tolerance)
    for line in found.errors:
        print(f"analyse: {line}", file=sys.stderr)
    if unknown and found.swings:
        print(f"analyse: {unknown}", file=sys.stderr)
    result = None
    if wanted is not None:
        topics = {one.source: one.topics for one in found.findings}
        joints = dict.fromkeys(name for one in found.findings for name in one.joints)
        muscles = dict.fromkeys(name for one in found.findings for name in one.muscles)
        result = check(wanted, found.swings, topics, tuple(joints), tuple(muscles))
    if found.findings:
        if arguments.json:
            differences = comparison[0] if comparison is not None else ()
            record = findings_record(found.findings, limits, result, differences)
            say(_json(record))
        else:
            say(_text(found.findings, limits, comparison, groups, result))
    if arguments.output is not None and found.findings:
        try:
            written = _write(
                arguments.output,
                found.findings,
                limits,
                arguments.formats,
                result,
                comparison,
                groups,
            )
        except OSError as error:
            print(f"analyse: cannot write {arguments.output}: {error}", file=sys.stderr)
            return UNUSABLE
        if not arguments.json:
            say(f"\nwritten: {written[0]} and {len(written) - 1} more files beside it")
    if found.errors:
        return UNUSABLE
    return VIOLATED if result is not None and not result.passed else PASSED


def _json(record: dict[str, Any]) -> str:
    """Return a record as JSON, which has no word for NaN: unknown is null already."""
    return json.dumps(record, indent=2, allow_nan=False)


def _text(
    findings: Sequence[BagFindings],
    limits: MotorLimits,
    comparison: _Comparison | None,
    groups: tuple[str, str],
    result: CheckResult | None,
) -> str:
    parts = [findings_text(findings, limits)]
    if comparison is not None:
        parts.append(comparison_text(*groups, comparison[0]))
    if result is not None:
        parts.append(check_text(result))
    return "\n\n".join(parts)


if __name__ == "__main__":
    raise SystemExit(main())
