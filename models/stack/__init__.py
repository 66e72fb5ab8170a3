"""Tolerance stacks: any requirement on any parts, linearised and exact."""
