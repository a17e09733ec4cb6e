"""The made-up recording, for every test here."""

from made_up_recording import recorded

__all__ = ["recorded"]
