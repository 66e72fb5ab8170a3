"""Loaded contact of the cycloid stage: exact geometry of pins and discs with every part error.

Angles in radians: psi is the angle of the first eccentric against the housing, counter-clockwise;
the carrier and the discs turn clockwise by psi/z_c, and that sense is "forward", the positive one
of every output rotation here. Disc d = 0, 1, ... has its eccentric at psi + 2 pi d/discs and is
itself turned by that angle, so that identical discs fit.
"""
