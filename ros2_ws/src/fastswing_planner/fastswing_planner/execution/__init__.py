"""The phases of a swing, advanced by explicit time."""
