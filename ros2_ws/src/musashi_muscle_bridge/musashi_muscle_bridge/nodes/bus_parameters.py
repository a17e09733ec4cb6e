"""The parameters of a bus, the same for both of its ends."""

from fastswing_planner.lifecycle.parameters import Parameter

BUS_URL = Parameter(
    "bus_url",
    "udp://127.0.0.1:48800",
    "Where the boards are: udp://HOST:PORT, serial:///DEVICE?baudrate=N, or a bus of your own; "
    "one for each of the robot's board_groups, separated by blanks.",
)
