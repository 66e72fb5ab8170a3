"""Parallel manipulator with full-circle rotation: kinematics, errors of its parts, pose errors.

Rebuilt from document M (Ni, Shao, Zhang, Guo, Adv. Mech. Eng. 2016, doi
10.1177/1687814016649300), whose equations are lost. Metres and radians; vectors are in the axes
(e_r, e_t, z) of the meridian plane at the azimuth phi, unless stated otherwise.
"""
