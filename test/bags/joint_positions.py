"""What is read of the bags that `bag_builder.write_joints` writes."""

import numpy as np

from fastswing_planner.bags import Bag

POSITION = np.arange(100.0)


def positions(bag: Bag) -> list[float]:
    """Return the first joint's."""
    return [float(value) for value in bag.columns("/joint_states")["position"][:, 0]]
