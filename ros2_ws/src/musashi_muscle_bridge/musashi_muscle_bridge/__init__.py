"""The bridge between ROS and muscle boards, and a mock of boards and arm."""
