"""Frames of the board protocol, and what carries them."""
