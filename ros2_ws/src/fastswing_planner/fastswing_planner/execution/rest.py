"""Whether the arm rests, from its joint speeds."""

from fastswing_planner.arrays import Vector


class RestWatch:
    """Notes since when all joints have been slow. Times are monotonic [s]."""

    def __init__(self, rest_speed: float, rest_time: float) -> None:
        """Begin without a measurement: not at rest.

        rest_speed  [rad/s] a joint rests at it or below it
        rest_time   [s] for which all joints must rest
        """
        self._rest_speed = rest_speed
        self._rest_time = rest_time
        self._since: float | None = None

    def add(self, time: float, joint_velocity: Vector) -> None:
        """Take joint speeds [rad/s], shape (n,), measured at `time` [s]."""
        # Plain numbers: for a few joints they are faster than numpy. NaN does not rest.
        limit = self._rest_speed
        for speed in joint_velocity.tolist():
            if not -limit <= speed <= limit:
                self._since = None
                return
        if self._since is None:
            self._since = time

    def resting(self, now: float) -> bool:
        """Return whether the arm has rested long enough at time `now` [s]."""
        return self._since is not None and now - self._since >= self._rest_time
