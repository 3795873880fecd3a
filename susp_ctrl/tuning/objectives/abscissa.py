r"""The spectral abscissa as an objective: place the rightmost root as far left as possible.

Every delayed signal becomes a transport line of N Chebyshev nodes beside the states (the operator whose
spectrum is that of the loop, discretised); the eigenvalues of all particles are found in one batched call.

References
----------
.. [1] D. Breda, S. Maset, R. Vermiglio, "Pseudospectral differencing methods for characteristic roots of delay
   differential equations", SIAM J. Sci. Comput. 27(2), 2005.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import DelayLTI, spectral_abscissa
from susp_ctrl.delay_systems.approximation import chebyshev_differentiation
from susp_ctrl.delay_systems.model import Realization
from susp_ctrl.tuning.sampling import ControlledPlant

# A line of no length has no nodes; ten microseconds turn a root at 100 rad/s by a thousandth of a radian.
SHORTEST_LINE = 1e-5


@dataclass(frozen=True)
class SpectralAbscissa:
    r"""Largest real part of the characteristic roots (1/s): :math:`J = \max_i \mathrm{Re}\, s_i`.

    Minimising it gives the loop the largest decay rate. During the search the roots come from a discretisation
    that is accurate up to about \|s\| tau = N; the designs that `tune` compares in the end are judged by their
    exact roots.

    Parameters
    ----------
    order : int
        Nodes N per delayed signal. A swarm step costs as many eigenvalue problems of size
        states + N channels as there are particles: much more than the other objectives.

    Raises
    ------
    InputError
        For an order below 4.
    """

    order: int = 20
    smooth = False

    def __post_init__(self) -> None:
        validation.integer("order", self.order, at_least=4)

    def bind(self, plant: ControlledPlant) -> SampledAbscissa:
        """Return the objective with its discretisation prepared."""
        D = chebyshev_differentiation(self.order)
        return SampledAbscissa(plant.realization, D[1:, 1:], D[1:, 0])


@dataclass(frozen=True, eq=False)
class SampledAbscissa:
    """The discretised loop of one plant: gains and delays (n, m) to spectral abscissas (n,)."""

    realization: Realization
    inner: FloatArray  # (N, N), node values to their slopes
    inflow: FloatArray  # (N,), the value entering the line to the slopes

    def accurate(self, gains: FloatArray, delays: FloatArray) -> float:
        """Return the abscissa of one design, (m,) gains and delays (s), from its exact roots."""
        return float(spectral_abscissa(DelayLTI(self.realization, delays, gains)))

    def evaluate(self, gains: FloatArray, delays: FloatArray) -> FloatArray:
        """Return the largest real part of each design's eigenvalues, shape (n,)."""
        r, nodes = self.realization, self.inflow.size
        n = r.n_states
        size = n + nodes * r.n_channels
        M = np.zeros((len(gains), size, size))
        M[:, :n, :n] = r.A
        ends = n + nodes * np.arange(1, r.n_channels + 1) - 1
        # w_k = g_k times the last node of line k.
        M[:, :n, ends] = r.B2 * gains[:, None, :]
        for k in range(r.n_channels):
            line = slice(n + nodes * k, n + nodes * (k + 1))
            speed = (2.0 / np.maximum(delays[:, k], SHORTEST_LINE))[:, None, None]
            M[:, line, line] += speed * self.inner
            M[:, line, :n] += speed * np.outer(self.inflow, r.C2[k])
            M[:, line, ends] += speed * self.inflow[:, None] * (r.D22[k] * gains)[:, None, :]
        return np.asarray(np.linalg.eigvals(M).real.max(axis=-1))
