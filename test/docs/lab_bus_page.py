"""The bus of docs/bring_your_own_boards.md, installed as the page says."""

import shlex
import subprocess
import sys
from pathlib import Path

from followed_page import read_page

PAGE = read_page("bring_your_own_boards.md")


def install_lab_bus(folder: Path) -> Path:
    """Write the page's files, install them; return the folder to put on PYTHONPATH.

    Beside the environment, not into it: other tests count on its two buses.
    """
    PAGE.write_files(folder)
    (command,) = PAGE.commands
    _, *arguments = shlex.split(command)
    target = folder / "installed"
    subprocess.run(
        [sys.executable, *arguments, "--quiet", "--target", str(target)], cwd=folder, check=True
    )
    return target
