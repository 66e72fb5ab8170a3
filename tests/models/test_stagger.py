"""Three ways to a stagger, against rigid registration and the contact of every pin."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tolevo.models.rv_reducer import geometry as stagger
from tolevo.models.rv_reducer.contact.contact import LoadedContact, backlash
from tolevo.models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from tolevo.models.rv_reducer.geometry import RvGeometry
from tolevo.units import ARCMIN, UM

Array = NDArray[np.float64]
GEOMETRY = RvGeometry()
TURN = 0.2 * ARCMIN
PITCH = np.linspace(0.0, 2.0 * np.pi / 40.0, 40, endpoint=False)
PERFECT = PartErrors()


def one_disc() -> LoadedContact:
    return LoadedContact(ContactGeometry(discs=1), exact=True)


def phase_for(turn: float) -> float:
    return float(stagger.parts(GEOMETRY, np.array([turn])).journal_phase[0])


@pytest.mark.parametrize("turn", [TURN, 0.05])
def test_offset_holes_turn_the_disc(turn: float) -> None:
    """The rotation of a rigid body that carries offset holes to the cranks, by Procrustes."""
    offset = float(stagger.parts(GEOMETRY, np.array([turn])).hole_offset[0])
    cranks = 0.036 * np.exp(2j * np.pi * np.arange(3) / 3)
    holes = cranks + 1j * offset * cranks / 0.036
    assert np.angle(np.vdot(cranks, holes)) == pytest.approx(turn, rel=1e-12)


def test_journals_ahead_are_a_turned_disc_at_a_later_angle() -> None:
    """At psi with the phase as at psi + phase with the disc turned back by phase/z_c.

    But for the lever arms, which the contact has at psi: they change by 1 % per 2.3 mrad.
    """
    contact, phase = one_disc(), phase_for(TURN)
    ahead = PartErrors(crank_phase=np.array([[[phase]]]))
    turned = PartErrors(angle=np.array([[-TURN]]))
    found = contact.mesh(ahead, PITCH).touch()
    wanted = contact.mesh(turned, PITCH + phase).touch()
    np.testing.assert_allclose(found, wanted, atol=0.01 * TURN)
    still = contact.mesh(PERFECT, PITCH).touch()
    assert np.all(np.abs(np.subtract(found, still)) > 0.9 * TURN)


def test_journals_turn_the_disc_by_the_angle_asked_on_average() -> None:
    contact, phase = one_disc(), phase_for(TURN)
    ratio = contact.geometry.output_ratio
    moved, still = (
        np.mean(contact.mesh(one, PITCH).touch(), axis=(1, 2)) * ratio
        for one in (PartErrors(crank_phase=np.array([[[-phase]]])), PERFECT)
    )
    np.testing.assert_allclose(still - moved, TURN, rtol=1e-3)


@pytest.mark.parametrize("way", ["turn", "journals"])
def test_both_discs_take_four_times_the_stagger_from_the_backlash(way: str) -> None:
    contact = LoadedContact(exact=True)
    turn = 0.2 * ARCMIN  # document B's delta' of 0.1 arcmin
    phase = phase_for(turn)
    moved = {
        "turn": PartErrors(angle=np.array([[turn, -turn]])),
        "journals": PartErrors(crank_phase=np.array([[[-phase, phase]]])),
    }[way]
    change = backlash(contact, moved, PITCH).mean() - backlash(contact, PERFECT, PITCH).mean()
    assert change * 121.0 / 117.0 / ARCMIN == pytest.approx(-0.4, rel=1e-3)


def test_dimensions_by_hand() -> None:
    """Of 0.2': 58.18 urad times 36 mm, 64 mm and 39, and 1.3 mm times the last."""
    found = stagger.parts(GEOMETRY, np.array([TURN]))
    wanted = [2.0944, 58.178e-6, 3.7234, 2.26893e-3, 2.9496]
    values = [
        found.hole_offset[0] / UM,
        found.blank_angle[0],
        found.at_rim[0] / UM,
        found.journal_phase[0],
        found.at_journal[0] / UM,
    ]
    np.testing.assert_allclose(values, wanted, rtol=2e-5)
