"""Serial arms: chains of revolute joints by a Denavit-Hartenberg table."""

MAX_JOINTS = 9
"""Revolute joints of the longest chain that can be declared."""
