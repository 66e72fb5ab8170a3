"""Simulated and measured units compared, and their differences attributed to inputs."""
