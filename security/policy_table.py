"""What each node may open: the one table that the permissions are made from.

Names are written as in ROS: `joint_states` is in the node's namespace, `/diagnostics` in none,
`~/get_state` below the node's own name. `test/security/test_security_policies.py` compares the
table with what the running nodes open, in both directions.
"""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Policy:
    """What one node may open; everything else is denied.

    node        name of the node; * stands for any characters
    publishes   topics that it writes
    subscribes  topics that it reads
    serves      services that it answers
    calls       services that it uses
    executes    actions that it answers
    orders      actions that it uses
    """

    node: str
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    executes: tuple[str, ...] = ()
    orders: tuple[str, ...] = ()


PARAMETER_SERVICES = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)
LIFECYCLE_SERVICES = (
    "change_state",
    "get_available_states",
    "get_available_transitions",
    "get_state",
    "get_transition_graph",
)
TYPE_SERVICE = "~/get_type_description"
STATES = ("joint_states", "muscle_state")
COMMANDS = ("length_command", "tension_command", "current_command", "current_override")
WATCHED = (*STATES, "inhibition_status", "swing_plan")
PICTURE = "arm_markers"
STOPS = ("emergency_stop", "hold_posture")


def _plain_node(policy: Policy) -> Policy:
    """Add what every rclpy node opens that is made with rclpy's own defaults."""
    return replace(
        policy,
        publishes=("/rosout", "/parameter_events", *policy.publishes),
        serves=(TYPE_SERVICE, *(f"~/{name}" for name in PARAMETER_SERVICES), *policy.serves),
    )


def _managed_node(policy: Policy) -> Policy:
    """Add what every node of this suite opens (`fastswing_planner/lifecycle/managed_node.py`)."""
    return _plain_node(
        replace(
            policy,
            publishes=("/diagnostics", "~/transition_event", *policy.publishes),
            serves=(*(f"~/{name}" for name in LIFECYCLE_SERVICES), *policy.serves),
        )
    )


NODES = tuple(
    map(
        _managed_node,
        (
            Policy(
                "bridge",
                publishes=STATES,
                subscribes=COMMANDS,
                serves=(*STOPS, "clear_faults"),
            ),
            Policy("mock_driver"),
            Policy("planner", serves=("plan_swing",)),
            Policy(
                "swing_executor",
                publishes=("length_command", "swing_plan"),
                subscribes=(*STATES, "inhibition_status", "length_command"),
                calls=("plan_swing", "arm_inhibitor", "disarm_inhibitor", "hold_posture"),
                executes=("execute_swing",),
            ),
            Policy(
                "inhibitor",
                publishes=("current_override", "inhibition_status"),
                subscribes=("joint_states",),
                serves=("arm_inhibitor", "disarm_inhibitor"),
            ),
            Policy(
                "monitor",
                subscribes=(
                    *STATES,
                    "current_override",
                    "inhibition_status",
                    "execute_swing/_action/feedback",
                    "/diagnostics",
                ),
                calls=(*STOPS, "clear_faults"),
            ),
            Policy("show_arm", publishes=(PICTURE,), subscribes=STATES),
            Policy("recorder", subscribes=(*WATCHED, *COMMANDS, "/diagnostics")),
        ),
    )
)
"""The suite's nodes. Each is a process and has an enclave of its own."""

PLANNER_CLIENT = Policy(
    "planner_client",
    publishes=("/parameter_events",),
    serves=(TYPE_SERVICE,),
    calls=("plan_swing",),
)
"""`fastswing_planner.client.PlannerClient`."""

TASK = _plain_node(
    Policy(
        "task",
        subscribes=(*WATCHED, "/diagnostics"),
        calls=("plan_swing", *STOPS),
        orders=("execute_swing",),
    )
)
"""Task code: plans, swings, watches and stops, but commands no muscle and clears no fault."""

COMMAND_LINE = Policy(
    "_ros2cli_*",
    publishes=("/parameter_events",),
    subscribes=(*WATCHED, *COMMANDS, PICTURE, "/diagnostics", "/rosout"),
    serves=(TYPE_SERVICE,),
    calls=(
        "plan_swing",
        "disarm_inhibitor",
        *STOPS,
        "clear_faults",
        *(
            f"{policy.node}/{service}"
            for policy in NODES
            for service in (*LIFECYCLE_SERVICES, *PARAMETER_SERVICES)
        ),
    ),
)
"""The operator's `ros2` commands: watch, stop, clear faults, parameters and lifecycle."""

ENCLAVES = {
    **{policy.node: (policy,) for policy in NODES},
    "task": (TASK, PLANNER_CLIENT),
    "operator": (COMMAND_LINE,),
}
"""Policies by enclave. One process is one enclave, however many nodes it holds."""

CLOCK = "/clock"
"""Read only by nodes that run on simulated time; permitted only when asked for."""
