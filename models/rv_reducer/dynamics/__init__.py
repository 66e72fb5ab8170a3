"""Transmission error: spectrum by order and torsional vibration over a mesh."""
