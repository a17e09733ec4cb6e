"""The whole suite as one loop without ROS, and its films."""
