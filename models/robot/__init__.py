"""Accuracy of a machine at its tool: from errors of links and reducers to poses (ISO 9283)."""
