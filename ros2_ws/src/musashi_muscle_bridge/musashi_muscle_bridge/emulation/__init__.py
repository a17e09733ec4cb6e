"""Emulated winches, wires, boards and faults."""
