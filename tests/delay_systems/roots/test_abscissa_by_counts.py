"""The spectral abscissa where the rightmost root is one of a chain with nearly the same real part."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special

import susp_ctrl as sc
from susp_ctrl.delay_systems.model.characteristic import CharacteristicMatrix
from susp_ctrl.delay_systems.roots.argument_principle import abscissa_by_counts


def scalar_loop(a: float, *delayed: tuple[float, float]) -> sc.DelayLTI:
    return sc.DelayLTI.from_state_delays([[[a]], *([[b]] for b, _ in delayed)], [d for _, d in delayed])


@pytest.mark.analytical
@pytest.mark.parametrize(("a", "b", "tau"), [(-1.0, -1.0, 1.0), (-2.0, 1.0, 10.0), (0.0, -1.0, 1.5)])
def test_counts_alone_enclose_the_abscissa_of_a_scalar_loop(a: float, b: float, tau: float) -> None:
    """x' = a x + b x(t - tau): rightmost root a + W0(b tau e^{-a tau})/tau."""
    exact = float((a + scipy.special.lambertw(b * tau * np.exp(-a * tau)) / tau).real)
    K = CharacteristicMatrix.of(scalar_loop(a, (b, tau)).folded)
    below, above = abscissa_by_counts(K, exact - 0.7, exact + 5.0)
    assert below <= exact + 1e-12
    assert above >= exact - 1e-12
    assert above - below < 1e-6 * max(1.0, abs(exact))


@pytest.mark.analytical
def test_a_fast_pole_with_weak_long_delays_has_a_confirmed_abscissa() -> None:
    """Hundreds of roots lie within 1e-5 of the rightmost real part, which a winding number around it tells apart."""
    a, delayed = -220.50475947768004, ((1.0258884647315464e-3, 8.0), (-3.62e-2, 0.5), (-0.1377, 0.25))
    loop = scalar_loop(a, *delayed)
    verdict = sc.stability(loop)
    assert verdict.stable
    assert sc.spectral_abscissa(loop) == pytest.approx(verdict.abscissa, rel=1e-6)

    def turns(line: float) -> int:
        omega = np.linspace(-2000.0, 2000.0, 2_000_001)
        s = line + 1j * omega
        values = (s - a - sum(b * np.exp(-s * d) for b, d in delayed)) / (s + 300.0)
        return -round(np.angle(values[1:] / values[:-1]).sum() / (2 * np.pi))

    assert turns(verdict.abscissa + 1e-5) == 0
    assert turns(verdict.abscissa - 1e-4) > 0
