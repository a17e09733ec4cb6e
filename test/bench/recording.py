"""What recording costs: four topics at 1 kHz into an MCAP bag, by the recorder as a process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import rclpy
from bag_reading import TYPES, samples
from rclpy.qos import QoSProfile, ReliabilityPolicy

from fastswing_msgs.msg import InhibitionStatus
from fastswing_planner.bags import open_bag
from fastswing_planner.nodes.recorded_topics import message_class

RATE_HZ = 1000.0
DOMAIN = 91
_WARM_UP_SEC = 1.0


def cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def record_four_topics(folder: Path, seconds: float, *options: str) -> dict[str, Any]:
    """Publish at 1 kHz for some seconds; returns what it cost.

    cpu: share of a core; messages sent, recorded, missing in between, and lost as the bag says.
    """
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    output = folder / "bag.mcap"
    command = [sys.executable, "-m", "fastswing_planner.nodes.recorder", "--ros-args"]
    recorder = subprocess.Popen([*command, "-p", f"output:={output}", *options])
    rclpy.init()
    try:
        sent, cpu = _publish(recorder, seconds)
        recorder.send_signal(signal.SIGINT)
        recorder.wait(30.0)
    finally:
        recorder.kill()
        rclpy.shutdown()
    bag = open_bag(output)
    counts = {name: bag.topics[name].message_count for name in sent}
    gaps = {}
    for name in sent:
        # What was sent before the recorder was found is in no gap.
        sequence = bag.columns(name, fields=[]).sequence.astype(int)
        gaps[name] = int(sequence.max() - sequence.min()) + 1 - sequence.size
    return {"cpu": cpu, "sent": sent, "recorded": counts, "gaps": gaps, "lost": bag.lost}


def _publish(recorder: "subprocess.Popen[bytes]", seconds: float) -> tuple[dict[str, int], float]:
    node = rclpy.create_node("publisher", start_parameter_services=False, enable_rosout=False)
    qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
    payloads: dict[str, list[Any]] = dict(samples())
    types = dict(TYPES)
    types["/inhibition_status"] = "fastswing_msgs/msg/InhibitionStatus"
    payloads["/inhibition_status"] = [
        InhibitionStatus(
            name=[f"#{i}" for i in range(1, 11)],
            speed_index=[0.1] * 10,
            latency_bound=[0.001] * 20,
            latency_count=[1] * 21,
        )
    ]
    publishers = {
        name: node.create_publisher(message_class(kind), name, qos) for name, kind in types.items()
    }
    begin = time.monotonic()
    while any(publisher.get_subscription_count() == 0 for publisher in publishers.values()):
        if time.monotonic() - begin > 30.0 or recorder.poll() is not None:
            raise TimeoutError("the recorder does not subscribe")
        time.sleep(0.05)
    sent = dict.fromkeys(types, 0)
    start = time.monotonic()
    cpu, cpu_from = 0.0, start
    step = 0
    while (now := time.monotonic()) - start < seconds + _WARM_UP_SEC:
        if not cpu and now - start > _WARM_UP_SEC:
            cpu, cpu_from = cpu_seconds(recorder.pid), now
        for name, publisher in publishers.items():
            rows = payloads[name]
            publisher.publish(rows[step % len(rows)])
            sent[name] += 1
        step += 1
        time.sleep(max(start + step / RATE_HZ - time.monotonic(), 0.0))
    share = (cpu_seconds(recorder.pid) - cpu) / (time.monotonic() - cpu_from)
    time.sleep(0.5)
    return sent, share
