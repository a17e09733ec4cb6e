"""Installs the bridge, the mock driver, monitor, launch files and Musashi's description."""

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "musashi_muscle_bridge"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", glob("config/*")),
        (f"share/{PACKAGE}/description", glob("description/*")),
        (f"share/{PACKAGE}/launch", glob("launch/*")),
        (f"share/{PACKAGE}/rviz", glob("rviz/*")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="fastswing maintainers",
    maintainer_email="maintainers@fastswing.example",
    description="The bridge between ROS and the muscle boards, and a mock of boards and arm.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "bridge = musashi_muscle_bridge.nodes.bridge:main",
            "calibrate = musashi_muscle_bridge.commands.calibrate:main",
            "mock_driver = musashi_muscle_bridge.nodes.mock_driver:main",
            "monitor = musashi_muscle_bridge.nodes.monitor:main",
            "show_arm = musashi_muscle_bridge.nodes.show_arm:main",
            "simulate_swing = musashi_muscle_bridge.commands.simulate_swing:main",
            "view_swing = musashi_muscle_bridge.commands.view_swing:main",
        ],
        # A laboratory's own bus adds an entry to both, in a package of its own.
        "musashi_muscle_bridge.buses": [
            "serial = musashi_muscle_bridge.buses.serial_bus:SerialBus",
            "udp = musashi_muscle_bridge.buses.udp_bus:UdpBus",
        ],
        "musashi_muscle_bridge.board_ports": [
            "serial = musashi_muscle_bridge.buses.serial_bus:SerialBoardPort",
            "udp = musashi_muscle_bridge.buses.udp_bus:UdpBoardPort",
        ],
    },
)
