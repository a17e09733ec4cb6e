"""What a recorded experiment shows: swings, figures, latencies, rates; pages and checks of them.

Everything but `recording_reading`, `losses` and `analyse_command` works on arrays: no ROS, no bag.
"""
