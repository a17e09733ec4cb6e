"""The parameter that bridge and mock driver share."""

from fastswing_planner.parameters import Parameter

BUS_URL = Parameter(
    "bus_url",
    "udp://127.0.0.1:48800",
    "Where the boards are. The scheme selects the bus; udp is on loopback unless told otherwise.",
)
