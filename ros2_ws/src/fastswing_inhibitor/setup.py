"""Installs the inhibitor."""

from setuptools import find_packages, setup

PACKAGE = "fastswing_inhibitor"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="fastswing maintainers",
    maintainer_email="maintainers@fastswing.example",
    description="Method 1: zero current on fast antagonists while a swing is armed.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "inhibitor = fastswing_inhibitor.inhibitor_node:main",
            "replay = fastswing_inhibitor.replay.command:main",
        ],
    },
)
