"""Parameters of machine and drives that `robot_joint` declares."""

from __future__ import annotations

from dataclasses import replace

from ...declarations import Parameter
from ...models.manipulator import declared
from ..robot.outputs import FIXED_OUTPUTS
from ..robot.outputs import PARAMETERS as OF_ROBOTS

__all__ = ["FIXED_OUTPUTS", "PARAMETERS"]
_INDICES = ("rms_plane", "rms_volume")
_MACHINE = {
    "index": {
        "default": "rms_plane",
        "choices": _INDICES,
        "source": "",
        "meaning": "mean over the ring: root mean square by the plane's area or by volume",
    },
    "follow_up": {
        "default": "rod",
        "choices": ("rod",),
        "source": "",
        "assumed": False,
        "meaning": "follow-up plane of chain 3, turned by its rod (M2); at the azimuth "
        "commanded (M1) the yaw of drives 1 and 2 would be lost",
    },
}
PARAMETERS: tuple[Parameter, ...] = (
    *(replace(p, **_MACHINE.get(p.name, {})) for p in declared.PARAMETERS),  # type: ignore[arg-type]
    *OF_ROBOTS,
)
