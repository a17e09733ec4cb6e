"""RViz's and Foxglove's files show the markers that show_arm publishes."""

import json
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory

from musashi_muscle_bridge.nodes.arm_markers import LIMP, LINKS, MUSCLES
from musashi_muscle_bridge.nodes.show_arm import TABLE

FRAME = {row.name: row.default for row in TABLE}["frame_id"]
RVIZ = Path(get_package_share_directory("musashi_muscle_bridge")) / "rviz" / "arm.rviz"
FOXGLOVE = Path(get_package_share_directory("fastswing_planner")) / "layouts" / "foxglove.json"


def test_rviz_draws_every_namespace_of_the_markers_in_their_frame() -> None:
    manager = yaml.safe_load(RVIZ.read_text())["Visualization Manager"]
    (arm,) = (one for one in manager["Displays"] if one["Class"].endswith("/MarkerArray"))
    assert manager["Global Options"]["Fixed Frame"] == FRAME
    assert arm["Topic"]["Value"] == "/arm_markers"
    assert arm["Namespaces"] == {LINKS: True, MUSCLES: True, LIMP: True}


def test_foxglove_draws_the_markers_in_their_frame() -> None:
    panel = json.loads(FOXGLOVE.read_text())["configById"]["3D!arm"]
    assert panel["topics"] == {"/arm_markers": {"visible": True}}
    assert panel["followTf"] == FRAME
