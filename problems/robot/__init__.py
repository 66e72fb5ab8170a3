"""Machines of links and reducers on one front: what every robot's problem has."""
