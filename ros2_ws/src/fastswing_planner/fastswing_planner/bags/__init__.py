"""MCAP bags, read and written without ROS."""

from fastswing_planner.bags.reader import Bag, open_bag
from fastswing_planner.bags.topics import Topic
from fastswing_planner.cdr.columns import Columns
from fastswing_planner.errors import BagError

__all__ = ["Bag", "BagError", "Columns", "Topic", "open_bag"]
