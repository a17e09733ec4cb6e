"""The middleware's transport, the same for all processes."""

import os


def choose_transport() -> None:
    """Have Fast DDS use UDP only, unless the environment says otherwise; call before rclpy.init.

    Its shared memory makes a node that follows a killed one deaf now and then: others take its
    port for the dead one's and remove it, and no emergency stop arrives any more.
    """
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
