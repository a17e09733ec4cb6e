"""Records topics into an MCAP bag.

ros2 run fastswing_planner record --ros-args -p output:=PATH.mcap
ros2 run fastswing_planner record --ros-args -p output:=FOLDER -p split_duration:=60.0
"""

import inspect
import json
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.exceptions import NameValidationException
from rclpy.validate_topic_name import validate_topic_name

from fastswing_planner.bags.folder import BagFolder, check_folder
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter, check_path
from fastswing_planner.conversion.definitions import (
    definition_text,
    split_type_name,
    type_hash,
)
from fastswing_planner.errors import BagError, DuplicateName, InvalidParameter, UnknownName
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.running import run
from fastswing_planner.nodes.recorded_topics import (
    QUEUE_DEPTH,
    RecordedTopic,
    message_class,
    offered_qos,
    parse,
    qos_for,
)
from fastswing_planner.nodes.recorder_parameters import TABLE


class WithInfo:
    """Makes rclpy pass the message information along.

    EventsExecutor of rclpy 7.1 passes message and information as one tuple, every other executor
    as two arguments.
    """

    __signature__ = inspect.signature(lambda data, info: None)

    def __init__(self, handle: Callable[[bytes, Mapping[str, Any]], None]) -> None:
        """`handle` gets message and information."""
        self._handle = handle

    def __call__(self, *arguments: Any) -> None:
        """Pass message and information on."""
        data, info = arguments if len(arguments) == 2 else arguments[0]
        self._handle(data, info)


class RecordNode(ManagedNode):
    """Active means: subscribed, and the file is open. Deactivated, the file is finished."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("recorder", TABLE)
        self._recorded: list[RecordedTopic] = []
        self._bag: BagWriter | BagFolder | None = None
        self._failure = ""

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Look up all types and judge the output, before anything is created."""
        if not parameters["output"]:
            raise InvalidParameter("set the parameter output to the new .mcap file or folder")
        self._output = Path(parameters["output"]).expanduser()
        self._split_size: int = parameters["split_size"]
        self._split_duration_ns = round(parameters["split_duration"] * 1e9)
        self._is_file = self._output.suffix == ".mcap"
        if self._is_file and (self._split_size or self._split_duration_ns):
            raise InvalidParameter(
                f"split_size and split_duration need a folder, and output is the file "
                f"'{parameters['output']}': leave .mcap away"
            )
        (check_path if self._is_file else check_folder)(self._output)
        self._compression: str = parameters["compression"]
        self._chunk_size: int = parameters["chunk_size"]
        self._recorded = [self._look_up(*parse(entry)) for entry in parameters["topics"]]
        names = [recorded.topic.name for recorded in self._recorded]
        for name in names:
            if names.count(name) > 1:
                raise DuplicateName(f"topic {name} is named more than once in topics")
        self._flush_timer = self.create_steady_timer(parameters["flush_period"], self._on_timer)

    def _look_up(self, name: str, type_name: str) -> RecordedTopic:
        try:
            validate_topic_name(name)
            full_name = self.resolve_topic_name(name)
        except NameValidationException as error:
            raise UnknownName(f"'{name}' is no topic name: {error}") from error
        full_type = "/msg/".join(split_type_name(type_name))
        topic = BagTopic(full_name, full_type, definition_text(type_name))
        return RecordedTopic(topic, message_class(type_name), qos_for(name.rpartition("/")[2]))

    def cleanup(self) -> None:
        """Forget the topics."""
        self.destroy_timer(self._flush_timer)
        self._recorded = []

    def activate(self) -> None:
        """Create the file and subscribe."""
        distro = os.environ.get("ROS_DISTRO", "jazzy")
        options = (self._output, self._compression, self._chunk_size, distro, self._notes)
        self._failure = ""
        self._started = time.time()
        for recorded in self._recorded:
            recorded.messages = recorded.bytes = recorded.lost = recorded.sequence = 0
            recorded.next_file()
        if self._is_file:
            self._bag = BagWriter(*options)
        else:
            self._bag = BagFolder(*options, self._split_size, self._split_duration_ns)
        for recorded in self._recorded:
            self._subscribe(recorded)

    def _subscribe(self, recorded: RecordedTopic) -> None:
        def handle(data: bytes, info: Mapping[str, Any]) -> None:
            self._on_message(recorded, data, info)

        recorded.subscription = self.create_subscription(
            recorded.message_class,
            recorded.topic.name,
            WithInfo(self.guarded(handle)),
            recorded.qos,
            raw=True,
        )

    def deactivate(self) -> None:
        """Record what has arrived, unsubscribe, and finish the file."""
        try:
            for recorded in self._recorded:
                self._drain(recorded)
                self.destroy_subscription(recorded.subscription)
                recorded.subscription = None
        finally:
            self._close()

    def _close(self) -> None:
        bag, self._bag = self._bag, None
        if bag is None:
            return
        try:
            bag.close()
        except BagError as error:
            self._failed(error)
        else:
            self.get_logger().info(f"{bag.message_count} messages recorded in {bag.path}")

    def _drain(self, recorded: RecordedTopic) -> None:
        """Record what waits in the subscription's queue."""
        assert recorded.subscription is not None
        handle = recorded.subscription.handle
        with handle:
            for _ in range(QUEUE_DEPTH):
                waiting = handle.take_message(recorded.message_class, True)
                if waiting is None:
                    return
                self._on_message(recorded, *waiting)

    def _notes(self) -> dict[str, str]:
        """Return what a file that is being finished says of its part of the recording."""
        messages = {one.topic.name: one.messages - one.earlier_messages for one in self._recorded}
        lost = {one.topic.name: one.lost - one.earlier_lost for one in self._recorded}
        for recorded in self._recorded:
            recorded.next_file()
        return {
            "node": self.get_fully_qualified_name(),
            "started": f"{self._started:.9f}",
            "finished": f"{time.time():.9f}",
            "messages": json.dumps(messages),
            "lost": json.dumps(lost),
        }

    # Messages.

    def _on_message(self, recorded: RecordedTopic, data: bytes, info: Mapping[str, Any]) -> None:
        if self._bag is None:
            return
        try:
            if recorded.topic.name not in self._bag.topics:
                self._announce(self._bag, recorded)
            log_time, publish_time = self._times(info)
            sequence = info.get("publication_sequence_number") or 0
            self._bag.write(recorded.topic.name, data, log_time, publish_time, sequence)
        except BagError as error:
            self._failed(error)
            return
        recorded.count(len(data), sequence)

    def _times(self, info: Mapping[str, Any]) -> tuple[int, int]:
        """Return when a message was received and published [ns]."""
        clock = self.get_clock()
        if clock.ros_time_is_active:
            now = clock.now().nanoseconds
            return now, now
        received = info["received_timestamp"] or clock.now().nanoseconds
        return received, info["source_timestamp"] or received

    def _announce(self, bag: BagWriter | BagFolder, recorded: RecordedTopic) -> None:
        """Add the topic to the bag, with what its publishers say of themselves."""
        topic = recorded.topic
        publishers = self.get_publishers_info_by_topic(topic.name)
        recorded.publishers = len(publishers)
        profiles = [publisher.qos_profile for publisher in publishers] or [recorded.qos]
        hashes = [str(publisher.topic_type_hash) for publisher in publishers]
        bag.add_topic(
            replace(
                topic,
                offered_qos=tuple(offered_qos(profile) for profile in profiles),
                type_hash=hashes[0] if hashes else type_hash(topic.type_name),
            )
        )

    def _on_timer(self) -> None:
        if self._failure and self.is_active:
            self.trigger_deactivate()
        elif self._bag is not None:
            try:
                self._bag.flush()
            except BagError as error:
                self._failed(error)

    def _failed(self, error: BagError) -> None:
        self._bag = None
        self._failure = str(error)
        self.get_logger().error(f"recording stopped: {error}")

    # Diagnostics.

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report what was recorded and what was lost."""
        values: dict[str, object] = {
            "output": self.get_parameter("output").value,
            "messages": sum(recorded.messages for recorded in self._recorded),
            "bytes": sum(recorded.bytes for recorded in self._recorded),
            "lost": sum(recorded.lost for recorded in self._recorded),
            "size": self._bag.size if self._bag is not None else 0,
        }
        for recorded in self._recorded:
            if recorded.subscription is not None:
                recorded.publishers = self.count_publishers(recorded.topic.name)
            values[f"publishers {recorded.topic.name}"] = recorded.publishers
            values[f"messages {recorded.topic.name}"] = recorded.messages
        if self._failure:
            return DiagnosticStatus.ERROR, self._failure, values
        if values["lost"]:
            return DiagnosticStatus.WARN, "messages were lost on the way here", values
        return DiagnosticStatus.OK, "ok", values


def main() -> int:
    """Run the node."""
    return run(RecordNode)


if __name__ == "__main__":
    raise SystemExit(main())
