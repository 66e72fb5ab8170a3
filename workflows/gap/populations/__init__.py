"""Populations: simulated and measured units compared, and what differs attributed to inputs."""
