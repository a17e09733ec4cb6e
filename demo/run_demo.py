"""Runs the demo; see `three_swings.py`.

Ctrl-C during the imports, seconds on a slow machine, just ends the process: Python's own
KeyboardInterrupt can get lost in an extension module.
"""

import signal
import sys


def main() -> int:
    """Import and run the demo; returns its exit code."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from three_swings import main as swing_three_times

    return swing_three_times()


if __name__ == "__main__":
    sys.exit(main())
