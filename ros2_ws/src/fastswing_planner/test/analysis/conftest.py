"""The made-up recording."""

from made_recording import recorded

__all__ = ["recorded"]
