"""What the monitor shows in a terminal."""
