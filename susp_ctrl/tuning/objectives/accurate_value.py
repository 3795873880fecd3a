r"""The value of one design by an evaluation of its own, as accurate as its response is sharp.

A search samples all designs at the same frequencies. Here the frequencies follow one design: its delays, the poles
of its plant, and the roots of its loop near the axis. These are zeros of :math:`\det(I - P_{22} E)`, whose magnitude
falls in proportion to the distance from them: its minima on a mesh give them away, however narrow the resonance is.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import integrate
from susp_ctrl.delay_systems.model import SampledPlant, around_resonances, return_determinant, sample_plant
from susp_ctrl.errors import TooMuchWorkError
from susp_ctrl.tuning.objectives.sampled_objective import weighted_response
from susp_ctrl.tuning.sampling import ControlledPlant

RELATIVE = 1e-9
WORST_ERROR = 1e-6  # beyond which an integral is doubted aloud
_MESH, _PER_TURN, _MOST_MESH = 300, 12, 400_000
_BELL = np.array([-30.0, -8.0, -2.0, 0.0, 2.0, 8.0, 30.0])  # half widths around a resonance
_NEWTON_STEPS = 6
_ZOOM, _ZOOMS = 33, 5
_COMPETING = 0.7  # samples 12 to the turn fall short of their peak by less


@dataclass(frozen=True, eq=False)
class DesignResponse:
    """The weighted response h of one design, at any frequencies of a band.

    Attributes
    ----------
    plant : ControlledPlant
    weigh : callable
        Frequencies (f,) to the plant sampled there with the scale of the rows in it.
    lag : float
        Longest delay of the road (s).
    gains, delays : ndarray, shape (channels,)
    """

    plant: ControlledPlant
    weigh: Callable[[FloatArray], SampledPlant]
    lag: float
    gains: FloatArray
    delays: FloatArray

    def at(self, omega: FloatArray) -> ComplexArray:
        """Return h, shape (f, rows)."""
        return weighted_response(self.weigh(omega), omega, self.gains[None], self.delays[None])[0]

    def mesh(self, low: float, high: float) -> FloatArray:
        """Return frequencies that follow the turns of the delays and the resonances of plant and loop.

        Raises
        ------
        TooMuchWorkError
            If the delays turn the response too often within the band.
        """
        turns = (high - low) * (self.lag + float(self.delays[self.gains != 0.0].sum())) / (2.0 * np.pi)
        even = int(np.ceil(_PER_TURN * turns)) + 2
        if even > _MOST_MESH:
            raise TooMuchWorkError(
                f"the delays turn the response {turns:.3g} times between {low:g} and {high:g} rad/s: smaller "
                f"delay_bounds are needed, for at most {_MOST_MESH // _PER_TURN} turns"
            )
        poles = self.plant.realization.eigenvalues
        first = np.concatenate([np.geomspace(low, high, _MESH), np.linspace(low, high, even)])
        near = around_resonances(poles[poles.imag > 0], _BELL)
        mesh = _within(np.concatenate([first, near]), low, high)
        roots = self._roots(mesh)
        return _within(np.concatenate([mesh, around_resonances(roots, _BELL)]), low, high)

    def _roots(self, mesh: FloatArray) -> NDArray[Any]:
        """Return roots of the loop near the axis, by Newton steps from the minima of its determinant."""
        size = np.abs(self._determinant(1j * mesh))
        lowest = 1 + np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (size[1:-1] < 0.5))
        s, reach = 1j * mesh[lowest], mesh[lowest + 1] - mesh[lowest - 1]
        step = 1e-4 * reach
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                ahead, behind = (self._determinant(s + 1j * sign * step) for sign in (1.0, -1.0))
                slope = (ahead - behind) / (2j * step)
                s = s - self._determinant(s) / slope
        return np.asarray(s[np.abs(s - 1j * mesh[lowest]) < 2.0 * reach])

    def _determinant(self, s: NDArray[Any]) -> ComplexArray:
        p22 = sample_plant(self.plant.realization, s).p22
        E = np.asarray(self.gains * np.exp(-s[:, None] * self.delays), dtype=complex)
        return return_determinant(p22, E)


def accurate_integral(
    response: DesignResponse, band: tuple[float, float], read: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Integrate what is read from the response, frequencies (f,) to (k, f), over a band.

    Warns
    -----
    RuntimeWarning
        If the integral is not known to 1e-6 of the largest.
    """
    mesh = response.mesh(*band)
    rough = np.max(np.trapezoid(read(mesh), mesh, axis=-1))
    # half a turn of the delays to a panel of 15 points at first
    result = integrate(read, *band, RELATIVE, mesh[::6], scale=1e-3 * rough)
    error = float(np.max(result.relative_error))
    if error > WORST_ERROR:
        warnings.warn(
            f"the objective of a design is known to {error:.1e} relative only: its integrand is not smooth",
            RuntimeWarning,
            stacklevel=2,
        )
    return result.value


def accurate_peak(response: DesignResponse, band: tuple[float, float]) -> float:
    """Return the largest sum of |h| over the rows in a band."""

    def lines(omega: FloatArray) -> FloatArray:
        return np.asarray(np.abs(response.at(omega.ravel())).sum(axis=-1).reshape(omega.shape))

    mesh = response.mesh(*band)
    values = lines(mesh)
    framed = np.concatenate([[-np.inf], values, [-np.inf]])
    tops = np.flatnonzero(
        (values >= framed[:-2]) & (values >= framed[2:]) & (values >= _COMPETING * values.max())
    )
    low, high = mesh[np.maximum(tops - 1, 0)], mesh[np.minimum(tops + 1, mesh.size - 1)]
    best = float(values.max())
    for _ in range(_ZOOMS):
        omega = np.linspace(low, high, _ZOOM)
        finer = lines(omega)
        best = max(best, float(finer.max()))
        k = finer.argmax(axis=0)
        column = np.arange(tops.size)
        low, high = omega[np.maximum(k - 1, 0), column], omega[np.minimum(k + 1, _ZOOM - 1), column]
    return best


def _within(omega: FloatArray, low: float, high: float) -> FloatArray:
    return np.unique(omega[(omega >= low) & (omega <= high)])
