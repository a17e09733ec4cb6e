"""Builds the C programs beside this file against the ROS that is in use."""

import os
import subprocess
import sysconfig
from pathlib import Path

_HERE = Path(__file__).parent
OUTPUT = _HERE.parents[1] / "out" / "bench" / "bin"
_LIBRARIES = (
    "rcl",
    "rcutils",
    "rmw",
    "rosidl_runtime_c",
    "sensor_msgs__rosidl_typesupport_c",
    "sensor_msgs__rosidl_generator_c",
    "fastswing_msgs__rosidl_typesupport_c",
    "fastswing_msgs__rosidl_generator_c",
    "m",
)


def baseline(name: str) -> Path:
    """Return the program made of NAME.c, built if it is older than its source.

    Needs a shell in which the workspace is sourced. Raises RuntimeError with the compiler's words.
    """
    source, program = _HERE / f"{name}.c", OUTPUT / name
    if program.exists() and program.stat().st_mtime > source.stat().st_mtime:
        return program
    OUTPUT.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        _command(source, program), capture_output=True, text=True, check=False, timeout=120.0
    )
    if done.returncode:
        raise RuntimeError(f"cannot build {source.name}:\n{done.stderr}")
    return program


def _command(source: Path, program: Path) -> list[str]:
    prefixes = [Path(part) for part in os.environ["AMENT_PREFIX_PATH"].split(":") if part]
    headers = [folder for prefix in prefixes for folder in sorted(prefix.glob("include/*"))]
    libraries = [str(prefix / "lib") for prefix in prefixes]
    needed = filter(None, os.environ.get("LD_LIBRARY_PATH", "").split(":"))
    python = str(sysconfig.get_config_var("LIBDIR"))
    return [
        os.environ.get("CC", "cc"),
        "-O2",
        str(source),
        "-o",
        str(program),
        *(f"-I{folder}" for folder in headers),
        *(f"-L{folder}" for folder in libraries),
        *(f"-Wl,-rpath-link,{folder}" for folder in (*libraries, *needed)),
        *(f"-l{library}" for library in _LIBRARIES),
        # ROS's message libraries call Python without naming its library.
        *(f"-L{python}", f"-Wl,-rpath,{python}", "-Wl,--no-as-needed"),
        f"-lpython{sysconfig.get_config_var('LDVERSION')}",
    ]
