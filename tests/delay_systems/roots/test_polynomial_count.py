"""The count on polynomials with delays, against roots that are known."""

from __future__ import annotations

import numpy as np
import pytest

from susp_ctrl.delay_systems.model import DelayPolynomials
from susp_ctrl.delay_systems.roots import ContourError, count_by_polynomials


def polynomial(coefficients, *delayed):
    """``p(s) + sum q_k(s) e^{-s tau_k}``; highest powers first."""
    parts = [(np.atleast_1d(coefficients), 0.0), *((np.atleast_1d(q), tau) for q, tau in delayed)]
    length = max(part.size for part, _ in parts)
    rows = [np.pad(part[::-1], (0, length - part.size)) for part, _ in parts]
    return DelayPolynomials(np.array(rows)[:, :, None, None], np.array([tau for _, tau in parts]))


@pytest.mark.analytical
@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e6])
@pytest.mark.parametrize(
    "roots",
    [
        [-1.0],
        [2.0],
        [1e-6, -1e6],
        [-3.0] * 8,
        [1.0] * 5 + [-2.0] * 6,
        [1e-3 + 1j, 1e-3 - 1j, -1e-3 + 1j, -1e-3 - 1j],
        [1e-6 + 5j, 1e-6 - 5j, -0.1, -400.0],
    ],
)
def test_polynomials_of_known_roots(roots, unit):
    given = np.array(roots) * unit
    T = polynomial(np.real(np.poly(given)))
    assert count_by_polynomials(T) == np.sum(given.real > 0)


@pytest.mark.analytical
@pytest.mark.parametrize(("gain", "delay"), [(1.0, 1.5), (1.0, 1.6), (0.1, 15.0), (0.1, 16.0), (3.0, 20.0)])
def test_the_delayed_integrator(gain, delay):
    """s + k e^{-s tau}: pairs of roots at k tau = pi/2 + 2 pi n."""
    expected = 2 * int(np.floor((gain * delay - np.pi / 2) / (2 * np.pi)) + 1)
    assert count_by_polynomials(polynomial([1.0, 0.0], (gain, delay))) == expected


def test_a_root_on_the_axis_and_open_leading_coefficients_are_told():
    with pytest.raises(ContourError, match="on the line near 2 rad/s"):
        count_by_polynomials(polynomial([1.0, 0.0, 4.0]))
    with pytest.raises(ContourError, match="leading coefficients"):
        count_by_polynomials(polynomial([1.0, 1.0], ([2.0, 1.0], 1.0)))
