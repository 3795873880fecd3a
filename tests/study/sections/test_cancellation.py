"""The closed form of J = 0 at one frequency."""

from __future__ import annotations

import numpy as np
import oracles
import pytest

import susp_ctrl as sc
from susp_ctrl.study.sections.cancellation import cancelling_feedback
from susp_ctrl.study.settings.vehicle import PairSettings

FRONT = PairSettings(
    measured="unsprung_displacement_front", actuator="force_front", gain_from=-34000.0, gain_to=34000.0
)
REAR = PairSettings(
    measured="unsprung_displacement_rear", actuator="force_rear", gain_from=-44000.0, gain_to=44000.0
)


@pytest.mark.literature
def test_the_four_designs_of_the_papers_box():
    """Section 4 of the restated paper gives these digits for 7 rad/s."""
    front, rear = cancelling_feedback(sc.HalfCar(), [FRONT, REAR], 7.0)
    assert np.array(front) == pytest.approx(np.array([[19981.24, 0.369757], [-19981.24, 0.818556]]), rel=2e-6)
    assert np.array(rear) == pytest.approx(np.array([[24377.24, 0.385185], [-24377.24, 0.833983]]), rel=2e-6)


@pytest.mark.analytical
@pytest.mark.parametrize("omega", [3.0, 7.0, 15.0])
def test_the_body_stands_still(omega):
    """Against the independent 4 x 4 equations: heave and pitch vanish for every road phase."""
    solutions = cancelling_feedback(sc.HalfCar(), [FRONT, REAR], omega)
    passive = np.abs(oracles.displacement_response(1j * omega)[2:]).max()
    checked = 0
    for g1, tau1 in solutions[0]:
        for g2, tau2 in solutions[1]:
            body = oracles.displacement_response(1j * omega, (g1, g2), (tau1, tau2))[2:]
            assert np.abs(body).max() < 1e-13 * passive
            checked += 1
    assert checked >= 1


@pytest.mark.analytical
def test_every_period_of_the_delay_is_found():
    wide = FRONT.__class__(
        measured=FRONT.measured,
        actuator=FRONT.actuator,
        gain_from=0.0,
        gain_to=1e6,
        delay_from=0.0,
        delay_to=4.0,
    )
    front, _ = cancelling_feedback(sc.HalfCar(), [wide, REAR], 7.0)
    delays = [tau for _, tau in front]
    assert len(delays) == 5
    assert np.diff(delays) == pytest.approx(2 * np.pi / 7.0, rel=1e-12)


def test_no_closed_form_for_other_feedback():
    other = PairSettings(
        measured="suspension_deflection_front", actuator="force_front", gain_from=-1.0, gain_to=1.0
    )
    assert cancelling_feedback(sc.HalfCar(), [other, REAR], 7.0) is None
    assert cancelling_feedback(sc.HalfCar(), [FRONT], 7.0) is None


def test_a_box_too_small_has_no_solution():
    small = PairSettings(measured=FRONT.measured, actuator=FRONT.actuator, gain_from=-100.0, gain_to=100.0)
    assert cancelling_feedback(sc.HalfCar(), [small, REAR], 7.0)[0] == []
