"""What CONTRIBUTING.md and the commit hooks tell a maintainer is there."""

import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
CONFIG: dict[str, Any] = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
HOOKS = [hook for repository in CONFIG["repos"] for hook in repository["hooks"]]
ON_FILES = [hook for hook in HOOKS if hook.get("pass_filenames", True)]
each_hook_on_files = pytest.mark.parametrize("hook", ON_FILES, ids=lambda hook: hook["id"])


def ask(hook: dict[str, Any], path: Path) -> int:
    """Return a hook's exit code for one file."""
    command = [*shlex.split(hook["entry"]), str(path)]
    return subprocess.run(command, cwd=ROOT, check=False, capture_output=True).returncode


def test_every_file_named_exists() -> None:
    named = re.findall(r"`((?:docs|requirements|ros2_ws|security|test)/[\w/.]+)`", TEXT)
    linked = re.findall(r"\]\(([^)#]+)\)", TEXT)
    assert named
    for path in [*named, *linked]:
        assert (ROOT / path).exists(), path


def test_every_folder_of_tests_named_exists() -> None:
    folders = re.findall(r"ARGS=(\w+)", TEXT)
    assert folders
    for folder in folders:
        assert list((ROOT / "ros2_ws" / "src").glob(f"*/test/{folder}/test_*.py")), folder


def test_the_hooks_fetch_nothing() -> None:
    assert {repository["repo"] for repository in CONFIG["repos"]} == {"local"}
    assert {hook["language"] for hook in HOOKS} == {"system"}


def test_the_hooks_use_the_pinned_tools() -> None:
    assert {hook["entry"].split()[0] for hook in HOOKS} == {".venv/bin/ruff", "make"}
    assert (ROOT / ".venv/bin/ruff").exists()


@each_hook_on_files
def test_a_hook_accepts_what_is_committed(hook: dict[str, Any]) -> None:
    assert ask(hook, ROOT / "conftest.py") == 0


@each_hook_on_files
def test_a_hook_refuses_what_is_wrong(hook: dict[str, Any], tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import os\nx = ( 1 )\n")
    assert ask(hook, wrong) == 1


def test_what_is_not_asked_of_a_commit_is_asked_of_a_push() -> None:
    (lint,) = (hook for hook in HOOKS if hook not in ON_FILES)
    assert (lint["entry"], lint["stages"]) == ("make lint", ["pre-push"])
