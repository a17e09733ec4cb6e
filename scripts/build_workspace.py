"""Builds the packages of the workspace that changed, after setting it up if that is needed."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import setup_workspace
import workspace_common as common
import workspace_python as pythons
from workspace_common import ROOT, WORKSPACE, WorkspaceError, say

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SOURCE = WORKSPACE / "src"
INSTALL = WORKSPACE / "install"
STAMP = INSTALL / ".fastswing-built"
# What an installed package is not made of.
IGNORED = (
    *("__pycache__", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis"),
    *("CHANGELOG.rst", "test"),
)
# In the stamp instead of a fingerprint: a build that never came to its end, and one that failed.
RUNNING, FAILED = "running", "failed"
RUN_COLCON = "import sys; from colcon_core.command import main; sys.exit(main())"


@dataclass(frozen=True)
class Sources:
    """A package's fingerprints: of the names of its files, and of what they hold."""

    names: str
    contents: str


def _files(package: Path) -> Iterator[Path]:
    for directory, folders, names in os.walk(package):
        folders[:] = sorted(name for name in folders if name not in IGNORED)
        for name in sorted(names):
            if name not in IGNORED and not name.endswith((".pyc", "~", ".swp")):
                yield package / directory / name


def fingerprint(package: Path) -> Sources:
    """Return the fingerprints of a package's files."""
    names, contents = hashlib.sha256(), hashlib.sha256()
    for path in _files(package):
        name = str(path.relative_to(package)).encode() + b"\0"
        names.update(name)
        contents.update(name + hashlib.sha256(path.read_bytes()).digest())
    return Sources(names.hexdigest(), contents.hexdigest())


def present() -> dict[str, Sources]:
    """Return the fingerprints of every package of the workspace, by the package's name."""
    return {p.parent.name: fingerprint(p.parent) for p in sorted(SOURCE.glob("*/package.xml"))}


def read_stamp() -> dict[str, Sources]:
    """Return the fingerprints of what is built."""
    try:
        lines = STAMP.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    fields = [line.split() for line in lines]
    return {f[0]: Sources(f[1], f[2]) for f in fields if len(f) == 3}


def _write_stamp(built: dict[str, Sources]) -> None:
    INSTALL.mkdir(parents=True, exist_ok=True)
    unfinished = STAMP.with_suffix(".new")
    lines = (f"{name} {s.names} {s.contents}\n" for name, s in built.items())
    unfinished.write_text("".join(lines), encoding="utf-8")
    unfinished.replace(STAMP)


def _forget(package: str) -> None:
    """Remove what was built of a package: installed files do not vanish with their sources."""
    for folder in ("build", "install"):
        shutil.rmtree(WORKSPACE / folder / package, ignore_errors=True)


def _colcon(packages: list[str]) -> list[str]:
    """Return the command that builds these packages and those which depend on them."""
    python = str(setup_workspace.VENV / "bin" / "python")
    places = ("build", "install")
    return [
        *(str(ROOT / "scripts" / "ros_env"), python, "-c", RUN_COLCON),
        *("--log-base", str(WORKSPACE / "log"), "build", "--base-paths", str(SOURCE)),
        *(text for p in places for text in (f"--{p}-base", str(WORKSPACE / p))),
        *("--event-handlers", "desktop_notification-", "status-"),
        *("--packages-above", *packages),
        *("--cmake-args", f"-DPython3_EXECUTABLE={python}", "-DBUILD_TESTING=OFF"),
        *("-DCMAKE_BUILD_TYPE=Release", "--no-warn-unused-cli"),
    ]


def _environment() -> dict[str, str]:
    environment = common.clean_environment()
    environment["FASTSWING_UNDERLAY_ONLY"] = "1"
    environment["COLCON_DEFAULTS_FILE"] = os.devnull
    # setuptools warns about how colcon calls it; nobody here can act on that.
    environment["PYTHONWARNINGS"] = "ignore"
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return environment


def _succeeded(package: str) -> bool:
    """Whether colcon's last build of a package ended well, by colcon's own note."""
    try:
        return _result(package).read_text(encoding="utf-8").strip() == "0"
    except OSError:
        return False


def _result(package: str) -> Path:
    return WORKSPACE / "build" / package / "colcon_build.rc"


def _forget_outdated(built: dict[str, Sources], wanted: dict[str, Sources]) -> None:
    """Forget the packages whose old build does not help the next one, or harms it."""
    for name in {*built, *wanted}:
        old, new = built.get(name), wanted.get(name)
        if old is None or new is None or old.names != new.names or old.contents == RUNNING:
            _forget(name)


def _run_colcon(wanted: dict[str, Sources], changed: list[str], lock: int) -> None:
    """Build, and note what came of it even if it fails or is interrupted."""
    for name in changed:
        _result(name).unlink(missing_ok=True)
    _write_stamp({n: Sources(s.names, RUNNING) if n in changed else s for n, s in wanted.items()})
    try:
        status = common.run_child(_colcon(changed), lock, _environment())
    finally:
        outcome = {n: s if _succeeded(n) else Sources(s.names, FAILED) for n, s in wanted.items()}
        _write_stamp(outcome)
    if status != 0 or outcome != wanted:
        raise WorkspaceError(f"colcon failed; see above and {WORKSPACE.name}/log/latest_build")


def _build(wanted: dict[str, Sources], lock: int) -> None:
    """Build the packages that changed since the last build."""
    built = read_stamp()
    changed = [name for name, sources in wanted.items() if built.get(name) != sources]
    _forget_outdated(built, wanted)
    if changed:
        pythons.check_tools()
        say(f"build: {' '.join(changed)}")
        _run_colcon(wanted, changed, lock)
    _write_stamp(wanted)


def main() -> None:
    """Set up and build what is not."""
    setup_workspace.ensure_environment()
    wanted = present()
    if read_stamp() == wanted:
        return
    with common.exclusive_lock() as lock:
        wanted = present()
        _build(wanted, lock)


if __name__ == "__main__":
    sys.exit(common.run_program("build", main))
