"""The planner, the swing executor and the recorder."""
