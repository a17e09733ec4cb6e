"""Runs the tests: those without ROS from the sources, on all cores; the others one by one.

run_tests.py unit|system|all [FOLDER | PYTEST ARGUMENT]...

A FOLDER is the name of a folder of tests, such as `planning`; it stands for all of that name.
"""

from __future__ import annotations

import os
import subprocess
import sys

from workspace_common import ROOT, WORKSPACE, WorkspaceError, run_program

SOURCE = WORKSPACE / "src"
METADATA = ROOT / "out" / "unit"
WITHOUT_VALUE = ("-q", "-qq", "-v", "-vv", "-x", "-s", "-l", "--lf", "--ff", "--co")
NO_TEST = 5  # pytest's exit code


def expanded(part: str, arguments: list[str]) -> list[str]:
    """Return pytest's arguments, names of folders replaced by the folders.

    The tests across packages all need ROS, and so does what they have in common.
    """
    across = [] if part == "unit" else [ROOT / "test"]
    roots = [*across, *sorted(SOURCE.glob("*/test"))]
    result = []
    for before, argument in zip(["-x", *arguments], arguments):
        value = before.startswith("-") and before not in WITHOUT_VALUE and "=" not in before
        if value or argument.startswith("-") or "/" in argument:
            result.append(argument)
            continue
        found = [path for root in roots for path in sorted(root.rglob(argument)) if path.is_dir()]
        if not found:
            names = {path.name for root in roots for path in root.iterdir() if path.is_dir()}
            choices = ", ".join(sorted(name for name in names if name[0] not in "._"))
            raise WorkspaceError(f"no tests are called '{argument}', choose from: {choices}")
        result += [str(path.relative_to(ROOT)) for path in found]
    return result


def entry_points() -> None:
    """Let the sources have the entry points that an installation has: buses are found by them."""
    METADATA.mkdir(parents=True, exist_ok=True)
    for setup in SOURCE.glob("*/setup.py"):
        command = [sys.executable, "-W", "ignore", "setup.py", "-q", "egg_info"]
        subprocess.run([*command, "--egg-base", str(METADATA)], cwd=setup.parent, check=True)


def from_sources() -> dict[str, str]:
    """Return the environment of a run that needs no build and no ROS."""
    entry_points()
    path = [METADATA, *(setup.parent for setup in sorted(SOURCE.glob("*/setup.py")))]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, path)),
        # ROS's wheels start every Python twice, to find libraries that nothing here needs.
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
    }


def pytest(part: str, arguments: list[str], environment: dict[str, str]) -> int:
    """Run one part; return pytest's exit code."""
    command = [sys.executable, "-m", "pytest", f"--part={part}", *arguments]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def unit(arguments: list[str], environment: dict[str, str], profile: str) -> int:
    """Run what needs no ROS; a part of it is done before a second process has begun."""
    options = [f"--hypothesis-profile={profile}", *arguments]
    if not any((ROOT / one.partition("::")[0]).exists() for one in arguments):
        options += ["-n", "2", str(SOURCE.relative_to(ROOT))]
    return pytest("unit", options, environment)


def main() -> None:
    """Run the part that is asked for; raises SystemExit with pytest's exit code."""
    part = sys.argv[1]
    arguments = expanded(part, sys.argv[2:])
    if part == "unit":
        code = unit(arguments, from_sources(), "quick")
        if code == NO_TEST:
            raise WorkspaceError("none of these tests is without ROS: make system runs the others")
        raise SystemExit(code)
    if part == "system":
        raise SystemExit(pytest("system", arguments, dict(os.environ)))
    codes = [unit(arguments, dict(os.environ), "full")]
    codes.append(pytest("system", arguments, dict(os.environ)))
    wrong = [code for code in codes if code not in (0, NO_TEST)]
    raise SystemExit(wrong[0] if wrong else min(codes))


if __name__ == "__main__":
    sys.exit(run_program("tests", main))
