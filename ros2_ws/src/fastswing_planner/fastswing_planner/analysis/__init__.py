"""What a recorded experiment shows: swings, figures, latencies, rates; pages and checks of them.

Only `recording_reading`, `recorded_plan`, `losses` and `analyse_command` know messages or bags; all
else works on arrays.
"""
