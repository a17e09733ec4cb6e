"""From ROS names to the DDS topics behind them, which is what DDS permissions are about."""

from collections.abc import Iterable
from dataclasses import dataclass

from policy_table import CLOCK, Policy

DISCOVERY_TOPIC = "ros_discovery_info"
"""Written and read by every ROS participant; tells which node owns which endpoint."""

_ACTION_SERVICES = ("cancel_goal", "get_result", "send_goal")
_ACTION_TOPICS = ("feedback", "status")


@dataclass(frozen=True)
class Access:
    """DDS topics that a participant may write and read."""

    publish: frozenset[str]
    subscribe: frozenset[str]

    def __or__(self, other: "Access") -> "Access":
        """Return what either of the two permits."""
        return Access(self.publish | other.publish, self.subscribe | other.subscribe)


EVERY_PARTICIPANT = Access(frozenset([DISCOVERY_TOPIC]), frozenset([DISCOVERY_TOPIC]))


def full_name(name: str, namespace: str, node: str) -> str:
    """Return the absolute ROS name; `namespace` begins with a slash."""
    base = namespace.rstrip("/")
    if name.startswith("/"):
        return name
    if name.startswith("~/"):
        return f"{base}/{node}{name[1:]}"
    return f"{base}/{name}"


def _topics(names: Iterable[str]) -> frozenset[str]:
    return frozenset(f"rt{name}" for name in names)


def _requests(names: Iterable[str]) -> frozenset[str]:
    return frozenset(f"rq{name}Request" for name in names)


def _replies(names: Iterable[str]) -> frozenset[str]:
    return frozenset(f"rr{name}Reply" for name in names)


def access_of(policy: Policy, namespace: str, sim_time: bool = False) -> Access:
    """Return the DDS topics behind one node's policy."""

    def full(names: Iterable[str]) -> list[str]:
        return [full_name(name, namespace, policy.node) for name in names]

    def parts(actions: Iterable[str], kinds: Iterable[str]) -> list[str]:
        return [f"{action}/_action/{kind}" for action in full(actions) for kind in kinds]

    served = [*full(policy.serves), *parts(policy.executes, _ACTION_SERVICES)]
    called = [*full(policy.calls), *parts(policy.orders, _ACTION_SERVICES)]
    written = [*full(policy.publishes), *parts(policy.executes, _ACTION_TOPICS)]
    read = [*full(policy.subscribes), *parts(policy.orders, _ACTION_TOPICS)]
    if sim_time:
        read.append(CLOCK)
    return Access(
        publish=_topics(written) | _replies(served) | _requests(called),
        subscribe=_topics(read) | _requests(served) | _replies(called),
    )


def enclave_access(
    policies: Iterable[Policy], namespace: str = "/", sim_time: bool = False
) -> Access:
    """Return what an enclave with these nodes may write and read."""
    access = EVERY_PARTICIPANT
    for policy in policies:
        access |= access_of(policy, namespace, sim_time)
    return access
