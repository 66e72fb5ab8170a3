"""Forward kinematics of a chain of revolute joints (Denavit and Hartenberg 1955).

The transform of a joint is Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta). beta is
Hayati's fifth parameter, 0 nominally: with two neighbouring axes parallel a small change of the
table's four moves the common normal without limit (Hayati and Mirmirani, J. Robotic Systems 2,
1985).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array


@dataclass(frozen=True, slots=True)
class Chain:
    """Joints (k,) from the base: lengths [m], angles [rad].

    `zero` is added to every joint angle. `base` (6,) and `tool` (3,) locate the chain's frame and
    the measured point: position [m] and rotation vector [rad] in the measuring frame, and
    position [m] in the last joint's frame.
    """

    zero: Array
    d: Array
    a: Array
    alpha: Array
    beta: Array
    base: Array
    tool: Array


def positions(chain: Chain, angles: Array) -> Array:
    """Measured point (n, 3) [m] at joint angles (n, k) [rad]."""
    point = np.broadcast_to(chain.tool, (len(angles), 3))
    for at in range(len(chain.d) - 1, -1, -1):
        point = _through(chain, at, angles[:, at] + chain.zero[at], point)
    return np.asarray(point @ rotation(chain.base[3:]).T + chain.base[:3])


def _through(chain: Chain, at: int, theta: Array, point: Array) -> Array:
    """A point (n, 3) of the frame after joint `at`, in the frame before it."""
    x, y, z = point.T
    cos, sin = np.cos(chain.beta[at]), np.sin(chain.beta[at])
    x, z = cos * x + sin * z, cos * z - sin * x
    cos, sin = np.cos(chain.alpha[at]), np.sin(chain.alpha[at])
    x, y, z = x + chain.a[at], y * cos - z * sin, y * sin + z * cos
    c, s = np.cos(theta), np.sin(theta)
    return np.column_stack([c * x - s * y, s * x + c * y, z + chain.d[at]])


def rotation(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector (3,) [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
