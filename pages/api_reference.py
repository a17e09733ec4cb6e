"""Builds the API reference from the docstrings, without a network; a warning is an error.

scripts/ros_env python pages/api_reference.py [FOLDER]
"""

import argparse
import inspect
import pkgutil
import sys
import warnings
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pdoc
import pdoc.render
from parameter_page import PACKAGES

ROOT = Path(__file__).parents[1]


class Undocumented(Exception):
    """The reference would lack something; the text names it."""


def modules(packages: Sequence[str]) -> list[str]:
    """Return the name of every module of some packages."""
    names = list(packages)
    for package in packages:
        paths = import_module(package).__path__
        names += [module.name for module in pkgutil.walk_packages(paths, f"{package}.")]
    return sorted(names)


def undocumented(module: ModuleType) -> Iterator[str]:
    """Yield the public things of a module that have no docstring of their own."""
    if not module.__doc__:
        yield module.__name__
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", "") == module.__name__
        if (
            name.startswith("_")
            or not own
            or not (inspect.isclass(thing) or inspect.isfunction(thing))
        ):
            continue
        if not thing.__doc__:
            yield f"{module.__name__}.{name}"


def build(folder: Path, packages: Sequence[str] = PACKAGES) -> None:
    """Write the reference into a folder; raises what pdoc warns of, or Undocumented."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # ROS's parser uses a deprecated module.
        warnings.filterwarnings("ignore", "module 'sre_", DeprecationWarning)
        missing = [
            thing for name in modules(packages) for thing in undocumented(import_module(name))
        ]
        if missing:
            raise Undocumented(f"no docstring: {', '.join(missing)}")
        pdoc.render.configure(
            docformat="markdown",
            template_directory=Path(__file__).with_name("reference_style"),
            footer_text="fastswing",
        )
        pdoc.pdoc(*packages, output_directory=folder)


def main() -> int:
    """Run the command; returns 0, or 1 if a docstring is missing."""
    parser = argparse.ArgumentParser(prog="api_reference", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "out" / "docs")
    folder: Path = parser.parse_args().folder
    try:
        build(folder)
    except Undocumented as error:
        print(f"api_reference: {error}", file=sys.stderr)
        return 1
    print(f"written: {folder}/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
