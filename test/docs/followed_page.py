"""Follows a page of the documentation to the letter: its files, its commands, what they print."""

import re
import shlex
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from processes import executable

DOCS = Path(__file__).parents[2] / "docs"
_TIMEOUT_SEC = 300.0


@dataclass(frozen=True)
class FollowedPage:
    """What a page tells its reader to do.

    files     text of each file by name: a block after a paragraph that ends in "`NAME`:"
    commands  the lines of all blocks of sh
    promised  the blocks of text, what the commands print
    """

    files: Mapping[str, str]
    commands: tuple[str, ...]
    promised: tuple[str, ...]

    def write_files(self, folder: Path) -> None:
        """Write every file into a folder."""
        for name, text in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def run(self, folder: Path, number: int) -> str:
        """Return what a command prints in this folder; raises CalledProcessError if it fails."""
        return _run(self.commands[number], folder)


def read_page(name: str) -> FollowedPage:
    """Read `docs/NAME`."""
    text = (DOCS / name).read_text()
    blocks = re.findall(r"^ *```(\w+)\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return FollowedPage(
        dict(re.findall(r"`([\w./-]+)`:\n\n```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)),
        tuple(line for kind, block in blocks if kind == "sh" for line in block.splitlines()),
        tuple(block for kind, block in blocks if kind == "text"),
    )


def _run(line: str, folder: Path) -> str:
    # What `ros2 run` starts, whichever `ros2` there is.
    _, _, package, name, *arguments = shlex.split(line)
    run = subprocess.run(
        [str(executable(package, name)), *arguments],
        cwd=folder,
        check=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=_TIMEOUT_SEC,
    )
    return run.stdout
