"""Finds the swings in bags and measures them.

ros2 run fastswing_planner analyse BAG... [--output FOLDER] [--check LIMITS.yaml] [--json]
ros2 run fastswing_planner analyse --compare A B [--output FOLDER]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.motor_limits import MotorLimits, motor_limits
from fastswing_planner.analysis.report.record import json_text
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.report.text import results_text
from fastswing_planner.analysis.verdicts.checks import CheckResult, check
from fastswing_planner.analysis.verdicts.comparison import Comparison, compare
from fastswing_planner.analysis.verdicts.criteria import Criteria, CriteriaError, read_criteria
from fastswing_planner.command_line import say
from fastswing_planner.commands.analysed_bags import (
    AnalysedBags,
    analyse_bags,
    bags_of_group,
    short_names,
)
from fastswing_planner.errors import InvalidLimit, RobotDescriptionError
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

_DEFAULTS = FindingSettings()
PAGE_NAME = "report.html"

PASSED, VIOLATED, UNUSABLE = 0, 1, 2
"""Exit codes: fine; a limit was violated; a bag, file or argument cannot be used."""


def _limits_of_robot(argument: str | None) -> tuple[MotorLimits, str]:
    """Return the motors' limits, and why they are not known."""
    try:
        return motor_limits(load_robot(argument or MUSASHI)), ""
    except RobotDescriptionError as error:
        if argument is not None:
            raise
        return {}, f"speed limits are not known: {error}"


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
    _add_settings(parser)
    return parser


def _add_settings(parser: argparse.ArgumentParser) -> None:
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
        criteria = None if arguments.check is None else read_criteria(arguments.check)
        limits, unknown = _limits_of_robot(arguments.robot)
    except (InvalidLimit, CriteriaError, RobotDescriptionError) as error:
        _complain(f"{error}")
        return UNUSABLE
    groups = [bags_of_group(path) for path in arguments.compare or ()]
    paths = [path for group in groups for path in group] or arguments.bags
    bags = analyse_bags(paths, settings, arguments.tolerance)
    for line in bags.errors:
        _complain(line)
    if unknown and bags.swings:
        _complain(unknown)
    result = None if criteria is None else _check(criteria, bags)
    comparison = _comparison(arguments.compare, groups, bags) if groups else None
    told = not bags.findings or _tell(arguments, Results(bags.findings, limits, result, comparison))
    if bags.errors or not told:
        return UNUSABLE
    return VIOLATED if result is not None and not result.passed else PASSED


def _complain(line: str) -> None:
    print(f"analyse: {line}", file=sys.stderr)


def _check(criteria: Criteria, bags: AnalysedBags) -> CheckResult:
    topics = {one.source: one.topics for one in bags.findings}
    joints = dict.fromkeys(name for one in bags.findings for name in one.joints)
    muscles = dict.fromkeys(name for one in bags.findings for name in one.muscles)
    return check(criteria, bags.swings, topics, tuple(joints), tuple(muscles))


def _comparison(
    named: Sequence[Path], groups: Sequence[Sequence[Path]], bags: AnalysedBags
) -> Comparison:
    first_name, second_name = short_names(named)
    first, second = (bags.swings_of(group) for group in groups)
    return Comparison((first_name, second_name), first, second, compare(first, second))


def _tell(arguments: argparse.Namespace, results: Results) -> bool:
    """Print and write the results; returns whether all could be written."""
    say(json_text(results) if arguments.json else results_text(results))
    if arguments.output is None:
        return True
    # Nothing else needs matplotlib and jinja2, which are slow to import.
    from fastswing_planner.analysis.report.folder import write_folder

    try:
        written = write_folder(arguments.output, PAGE_NAME, results, arguments.formats)
    except OSError as error:
        _complain(f"cannot write {arguments.output}: {error}")
        return False
    if not arguments.json:
        say(f"\nwritten: {written[0]} and {len(written) - 1} more files beside it")
    return True


if __name__ == "__main__":
    raise SystemExit(main())
