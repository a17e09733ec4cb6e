"""The live picture of the arm, from the installed executable over DDS."""

import signal
from typing import TYPE_CHECKING

import pytest
from lifecycle_msgs.msg import State
from visualization_msgs.msg import Marker, MarkerArray

if TYPE_CHECKING:
    from test.system.suite import Suite


PATIENT_SEC = 2.0
RATE = 5.0


class Viewer:
    """Hears markers as RViz does."""

    def __init__(self, suite: "Suite") -> None:
        self.pictures: list[MarkerArray] = []
        suite.node.create_subscription(MarkerArray, "arm_markers", self.pictures.append, 10)


@pytest.fixture
def viewer(world: "Suite") -> Viewer:
    """Show the holding emulated arm."""
    shown = Viewer(world)
    world.start("bridge", watchdog_timeout=PATIENT_SEC)
    world.start("show_arm", rate=RATE, frame_id="shoulder")
    world.start_active("mock_driver")
    world.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    world.hold()
    world.until("pictures with muscles", lambda: muscles_in(shown) == 10)
    return shown


def muscles_in(viewer: Viewer) -> int:
    last = viewer.pictures[-1].markers if viewer.pictures else []
    return sum(marker.ns == "muscles" for marker in last)


def test_the_arm_is_drawn_in_the_frame_that_was_asked_for(viewer: Viewer) -> None:
    markers = viewer.pictures[-1].markers
    assert {marker.header.frame_id for marker in markers} == {"shoulder"}
    assert {"links", "muscles"} <= {marker.ns for marker in markers}
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
    assert {marker.lifetime.nanosec for marker in markers} == {500_000_000}


def test_pictures_are_not_more_often_than_asked_for(world: "Suite", viewer: Viewer) -> None:
    count = len(viewer.pictures)
    world.until("ten more pictures", lambda: len(viewer.pictures) >= count + 10)
    stamps = [picture.markers[0].header.stamp for picture in viewer.pictures[count:]]
    seconds = (stamps[-1].sec - stamps[0].sec) + (stamps[-1].nanosec - stamps[0].nanosec) * 1e-9
    # The states of 500 Hz are looked at five times a second; each picture shows a newer one.
    assert seconds > 0.8 * (len(stamps) - 1) / RATE


def test_muscles_without_current_are_outlined(world: "Suite", viewer: Viewer) -> None:
    world.trigger("emergency_stop")

    def outlined() -> bool:
        outlines = [one for one in viewer.pictures[-1].markers if one.ns == "zero_current"]
        return {one.action for one in outlines} == {Marker.ADD}

    world.until("outlines", outlined)


def test_an_arm_whose_states_end_is_not_drawn_again(world: "Suite", viewer: Viewer) -> None:
    bridge = world.processes["bridge"]
    bridge.send(signal.SIGKILL)
    bridge.wait(PATIENT_SEC)
    count = -1

    def unchanged() -> bool:
        nonlocal count
        before, count = count, len(viewer.pictures)
        drawn = world.reported("show_arm", "drawn")
        world.diagnostics.pop("show_arm", None)
        world.until("a report", lambda: world.reported("show_arm", "drawn") != "")
        return before == count and world.reported("show_arm", "drawn") == drawn

    world.until("no more pictures", unchanged)


def test_a_lifetime_shorter_than_two_pictures_is_refused(world: "Suite") -> None:
    process = world.start("show_arm", rate=5.0, lifetime=0.3)
    assert process.wait(60.0) == 2
    assert "expected at least two periods of rate: 0.4 s" in process.log.read_text()
