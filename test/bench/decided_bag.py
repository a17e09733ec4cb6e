"""A bag of joint states and what the inhibitor decided on them, to replay."""

from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Duration, Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_inhibitor.decision_messages import DecisionMessages
from fastswing_inhibitor.inhibition import Arming, Inhibition, InhibitionSettings, JointNumbers
from fastswing_inhibitor.latency_histogram import LatencyHistogram
from fastswing_msgs.msg import SwingPlan
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.robot.description import Robot

TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/inhibition_status": "fastswing_msgs/msg/InhibitionStatus",
}
_PLAN, _PLAN_TYPE = "/swing_plan", "fastswing_msgs/msg/SwingPlan"
_START_NS = 1_700_000_000_000_000_000
_PERIOD_SEC = 0.001
_WAY = 0.7  # of the swing, so that the goal is never reached


def write_decided_bag(path: Path, robot: Robot, count: int) -> Path:
    """Write `count` joint states of one long armed swing at 1 kHz, each with its decision."""
    model = robot.model
    start, goal = robot.postures["start"], robot.postures["end"]
    velocity = (goal - start) * _WAY / (count * _PERIOD_SEC)
    inhibition = Inhibition(model, robot.limits.velocity, InhibitionSettings())
    messages = DecisionMessages(model.muscle_names, Duration(), inhibition, LatencyHistogram())
    bag = BagWriter(path)
    for topic, type_name in (*TOPICS.items(), (_PLAN, _PLAN_TYPE)):
        bag.add_topic(BagTopic(topic, type_name, definition_text(type_name)))
    plan = SwingPlan(joint_name=model.joint_names, end_position=goal.tolist())
    bag.write(_PLAN, serialize_message(plan), _START_NS, _START_NS, 0)
    inhibition.see(0.0)
    nobody = np.zeros(len(model.muscle_names), dtype=bool)
    inhibition.arm(Arming(goal, 0.0, nobody, count * _PERIOD_SEC + 1.0, 0.0))
    for index in range(count):
        position = start + velocity * index * _PERIOD_SEC
        time_ns = _START_NS + index * 1_000_000
        header = Header(stamp=Time(sec=time_ns // 10**9, nanosec=time_ns % 10**9))
        decision = inhibition.decide(
            JointNumbers(index * _PERIOD_SEC, position.tolist(), velocity.tolist())
        )
        states = JointState(
            header=header,
            name=model.joint_names,
            position=position.tolist(),
            velocity=velocity.tolist(),
            effort=[0.0] * len(model.joint_names),
        )
        rows = zip(TOPICS, (states, messages.status(header, decision)), strict=True)
        for topic, message in rows:
            bag.write(topic, serialize_message(message), time_ns, time_ns, index)
    bag.close()
    return path
