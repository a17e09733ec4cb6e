"""Muscle lengths and moment arms learned from bags."""
