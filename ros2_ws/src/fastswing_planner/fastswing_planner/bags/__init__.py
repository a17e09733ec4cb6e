"""MCAP bags, read and written without ROS."""

from fastswing_planner.bags.reader import Bag, open_bag

__all__ = ["Bag", "open_bag"]
