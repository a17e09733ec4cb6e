"""ROS's message definitions, and serialised messages as numpy columns."""
