"""MCAP bags, read and written without ROS."""
