"""Where a robot's description lies."""

from pathlib import Path

from fastswing_planner.errors import RobotDescriptionError

MUSASHI = "package://musashi_muscle_bridge/description/musashi_left_arm.yaml"
"""The Musashi-like arm, the default robot of everything."""


def resolve_path(uri: str | Path) -> Path:
    """Return the file that a path or `package://PACKAGE/PATH` names.

    Raises RobotDescriptionError if the package is not installed.
    """
    uri = str(uri)
    if not uri.startswith("package://"):
        return Path(uri).expanduser()
    package, _, inner = uri.removeprefix("package://").partition("/")
    try:
        # Here, so that a robot named by its path needs no ROS.
        from ament_index_python.packages import get_package_share_directory

        return Path(get_package_share_directory(package)) / inner
    except (ImportError, LookupError, ValueError, OSError) as error:
        raise RobotDescriptionError(
            f"{uri}: package '{package}' is not installed; source its workspace, or give a path"
        ) from error
