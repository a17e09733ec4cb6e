"""The arm's shapes and the lines of its muscles, without ROS."""
