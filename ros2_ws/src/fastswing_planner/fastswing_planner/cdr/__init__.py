"""ROS's messages without ROS: definitions, stamps, and serialised ones as numpy columns."""
