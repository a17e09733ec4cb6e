"""Which files a bag consists of."""

import re
from collections.abc import Sequence
from pathlib import Path

import yaml

from fastswing_planner.errors import UnreadableBag


def bag_files(paths: Sequence[Path], warnings: list[str]) -> list[Path]:
    """Return the MCAP files that `paths`, files and folders, stand for, each once.

    What is missing is added to `warnings`. Raises UnreadableBag if a path holds no MCAP file.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        for file in _of_folder(path, warnings) if path.is_dir() else [_checked(path)]:
            found.setdefault(file.resolve(), file)
    return list(found.values())


def _checked(path: Path) -> Path:
    if not path.exists():
        raise UnreadableBag(f"there is no bag {path}")
    if path.suffix == ".db3":
        raise UnreadableBag(
            f"{path} is stored in sqlite3; convert it to mcap with ros2 bag convert"
        )
    if path.suffix in (".zstd", ".lz4"):
        raise UnreadableBag(f"{path} is compressed as a whole; unpack it first")
    if not path.is_file():
        raise UnreadableBag(f"{path} is no file")
    return path


def _of_folder(folder: Path, warnings: list[str]) -> list[Path]:
    present = sorted(folder.glob("*.mcap"), key=_by_number)
    listed = [folder / name for name in _listed(folder, warnings)]
    for path in listed:
        if path not in present:
            if path.exists():
                _checked(path)
            warnings.append(f"{path} is missing, though metadata.yaml names it")
    # A killed recorder wrote its last file and did not list it.
    for path in present:
        if listed and path not in listed:
            warnings.append(f"{path} is read too, though metadata.yaml does not name it")
    if not present:
        other = next(iter(sorted(folder.glob("*.db3"))), None)
        if other is not None:
            _checked(other)
        raise UnreadableBag(f"folder {folder} has no .mcap file")
    return present


def _listed(folder: Path, warnings: list[str]) -> list[str]:
    path = folder / "metadata.yaml"
    if not path.exists():
        return []
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        names = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(str(name)).name for name in names]
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError):
        warnings.append(f"{path} cannot be read; all .mcap files beside it are")
        return []


def _by_number(path: Path) -> list[tuple[int, str]]:
    """Order run_2 before run_10."""
    return [(int(part or 0), part) for part in re.split(r"(\d+)", path.name) if part.isdigit()] + [
        (0, path.name)
    ]
