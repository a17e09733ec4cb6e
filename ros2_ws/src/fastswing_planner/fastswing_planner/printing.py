"""What commands print."""

import os
import sys


def say(text: str) -> None:
    """Print a text, also to a reader that has seen enough, such as `head`."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Python would complain once more when it flushes at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
