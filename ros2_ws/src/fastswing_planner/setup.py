"""Installs the planner library and its executables."""

from setuptools import find_packages, setup

PACKAGE = "fastswing_planner"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed", "analysis/report/templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/layouts", ["layouts/foxglove.json", "layouts/plotjuggler.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="fastswing maintainers",
    maintainer_email="maintainers@fastswing.example",
    description="Plans, executes, records and analyses fast swings of tendon-driven arms.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "analyse = fastswing_planner.commands.analyse:main",
            "export_bag = fastswing_planner.commands.export_bag:main",
            "learn_model = fastswing_planner.commands.learn_model:main",
            "plan = fastswing_planner.commands.plan:main",
            "planner = fastswing_planner.nodes.planner:main",
            "record = fastswing_planner.nodes.recorder:main",
            "swing = fastswing_planner.commands.swing:main",
            "swing_executor = fastswing_planner.nodes.swing_executor:main",
        ],
    },
)
