"""Populations of RV reducers on their exact contact: units drawn to an allocation.

The gap of every pin is linear in the errors of the parts about the exact nominal profile, so that
one base sample serves every allocation (common random numbers) and derivatives follow from the pins
that touch. Angles are those of the carrier with the sun held, in arc minutes; lengths of errors
are micrometres and those of the geometry metres inside this package, because its kernels work in
single precision.
"""
