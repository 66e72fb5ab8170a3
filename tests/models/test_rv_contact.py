"""Loaded contact of the cycloid stage: figures of the physics notes, sections 4 and 5."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.rv_reducer.contact.contact import LoadedContact
from tolevo.models.rv_reducer.contact.errors import PartErrors
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry
from tolevo.units import ARCMIN

Array = NDArray[np.float64]
PERFECT = PartErrors()
PITCH = 2.0 * np.pi / 40.0 * np.arange(200) / 200  # a pin pitch of the crank angle


def one_disc(k_n: float, modified: bool = True) -> LoadedContact:
    """The convention of section 4's table: one disc, rigidly held, with 0.55 T on its mesh."""
    geometry = ContactGeometry(discs=1)
    geometry = geometry if modified else replace(geometry, dr_rp=0.0, dr_p=0.0)
    return LoadedContact(geometry, normal_stiffness=k_n * 1e3, series_stiffness=np.inf)


@pytest.mark.parametrize(
    ("torque", "k_n", "most", "mean", "loaded", "wind_up"),
    [
        (412.0, 2e5, 1315.0, 1278.0, 5.40, 0.492),
        (412.0, 6e5, 1852.0, 1804.0, 3.74, 0.262),
        (21.0, 2e5, 199.0, 159.0, 2.09, 0.112),
    ],
)
def test_table_of_section_4(
    torque: float, k_n: float, most: float, mean: float, loaded: float, wind_up: float
) -> None:
    contact = one_disc(k_n)
    ratio = contact.geometry.output_ratio
    found = contact.equilibrium(PERFECT, PITCH, 0.55 * torque * ratio)
    peak = found.pin_forces.max(axis=(0, 2, 3))
    np.testing.assert_allclose(peak.max(), most, atol=1.0)
    np.testing.assert_allclose(peak.mean(), mean, atol=1.0)
    np.testing.assert_allclose(found.loaded.mean(), loaded, atol=0.006)
    np.testing.assert_allclose(found.rotation.mean() * ratio / ARCMIN, wind_up, atol=6e-4)


def test_no_load_backlash_of_section_4() -> None:
    contact = one_disc(2e5)
    backward, forward = contact.mesh(PERFECT, PITCH).touch()
    found = (forward - backward) * contact.geometry.output_ratio / ARCMIN
    np.testing.assert_allclose([found.min(), found.max()], [0.111, 0.121], atol=5e-4)
    np.testing.assert_allclose(found.mean(), 0.1156, atol=5e-5)
