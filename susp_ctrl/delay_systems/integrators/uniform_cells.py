r"""Cells of one length in which delayed signals may have kinks at fixed places.

Where an input has a kink in every sample, cells cannot both be smooth and be long. Cells as long as the sampling
step have the kinks of the input at their edges, and a delay :math:`\tau = (m + \varphi) h` moves those of the
delayed signal to the place :math:`\varphi` of every cell: there it changes from the polynomial of one earlier cell
to that of the next. With both polynomials known the plant's response over the cell,

.. math:: \xi(s) = e^{Ts} \xi(0) + \int_0^s e^{T(s - \sigma)} (B_1 u(\sigma) + B_2 w(\sigma))\, d\sigma,

is one constant matrix, and a run is a linear recursion with constant coefficients.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.integrators.cells import GaussRule, PlantCoordinates
from susp_ctrl.delay_systems.model import Realization

_POINTS = 24  # of the quadrature over a cell: exact to rounding for decays up to e^-FASTEST_DECAY
FASTEST_DECAY = 12.0
_POINT, _WEIGHT = np.polynomial.legendre.leggauss(_POINTS)


class UniformCells:
    """Operators of the plant on cells of one length.

    Targets are the N nodes of a cell and its end. A delayed signal is given by its node values on two cells, the
    older and the newer of those that the cell sees through the delay.

    Parameters
    ----------
    plant : Realization
        Folded plant with D22 = 0.
    delays : ndarray, shape (channels,)
        Delays of at least one cell (s).
    coordinates : PlantCoordinates
        The same plant in diagonal or triangular form.
    rule : GaussRule
        Nodes of a cell.
    length : float
        Length of a cell (s).
    rounding : float
        Times closer than this are one (s).

    Attributes
    ----------
    whole : ndarray of int, shape (channels,)
        Whole cells in each delay; the newer cell lies so many cells back, the older one more.
    step : ndarray of complex, shape (r, r)
        ``e^{T h}``.
    z_free : ndarray, shape (channels * N, 2 r)
        Delayed signals at the nodes from ``[Re xi; Im xi]`` at the start.
    from_delayed : ndarray, shape (channels * N + 2 r + channels, 2 * channels * N)
        From node values of [older, newer] cell of each channel to z at the nodes, the drive of xi over the cell
        (real, imaginary), and w at the start.
    reach : ndarray of complex, shape (N + 1, r, 2 * channels * N)
        From the same node values to xi at the targets.
    """

    def __init__(
        self,
        plant: Realization,
        delays: FloatArray,
        coordinates: PlantCoordinates,
        rule: GaussRule,
        length: float,
        rounding: float,
    ) -> None:
        self.plant, self.coordinates, self.rule, self.length = plant, coordinates, rule, length
        self.rounding = rounding
        self.targets = np.append(0.5 * length * (1.0 + rule.nodes), length)
        self._to_z = plant.C2 @ coordinates.back
        cells = delays / length
        self.whole = np.floor(cells + rounding / length).astype(int)
        self.kink = np.maximum(cells - self.whole, 0.0) * length
        self.kink[self.kink <= rounding] = 0.0
        K, N, r = plant.n_channels, rule.size, coordinates.size
        eye = np.eye(r, dtype=complex)
        self.step: ComplexArray = self.propagated(np.array(length), eye)
        free = self.propagated(self.targets[:-1], eye)
        self.z_free = self._z_rows(np.concatenate([free, 1j * free], axis=2))
        reach = np.zeros((N + 1, r, 2 * K * N), dtype=complex)
        at_start = np.zeros((K, 2 * K * N))
        for k in range(K):
            first, middle = 2 * k * N, (2 * k + 1) * N
            kink = float(self.kink[k])
            until = np.minimum(self.targets, kink)
            B2 = coordinates.B2[:, [k]]
            reach[:, :, first:middle] = self._through(B2, np.zeros(N + 1), until, length - kink)
            reach[:, :, middle : middle + N] = self._through(B2, until, self.targets, -kink)
            if kink > 0.0:
                at_start[k, first:middle] = rule.rows(np.array(1.0 - 2.0 * kink / length))
            else:
                at_start[k, middle : middle + N] = rule.rows(np.array(-1.0))
        self.reach = reach
        self.from_delayed = np.vstack([self._with_end(reach), at_start])

    def propagated(self, times: FloatArray, columns: FloatArray | ComplexArray) -> ComplexArray:
        """Return ``e^{T t} columns``, shape (*times.shape, r, columns)."""
        T = self.coordinates.T
        if self.coordinates.diagonal:
            return np.asarray(np.exp(times[..., None] * np.diag(T))[..., None] * columns, dtype=complex)
        return np.asarray(scipy.linalg.expm(times[..., None, None] * T) @ columns, dtype=complex)

    def from_samples(self, hold: str, rows: list[int]) -> FloatArray:
        """Return the way from samples at the cell's start and end to z at the nodes and the drive of xi.

        Parameters
        ----------
        hold : {"linear", "zero"}
            What the inputs do between.
        rows : list of int
            The inputs that are driven.

        Returns
        -------
        ndarray, shape (channels * N + 2 r, 2 * inputs)
        """
        B1, D21, N, q = self.coordinates.B1[:, rows], self.plant.D21[:, rows], self.rule.size, len(rows)
        to_end = np.zeros(N + 1) if hold == "zero" else self.targets / self.length
        shares = (1.0 - to_end, to_end)
        zero = np.zeros(N + 1)
        slope = self._moment(B1, zero, self.targets) if hold == "linear" else 0.0
        whole = self._moment(B1, zero, self.targets, constant=True)
        matrix = self._with_end(np.concatenate([whole - slope, slope + 0.0 * whole], axis=2))
        for j, share in enumerate(shares):
            direct = D21[:, None, :] * share[None, :-1, None]
            matrix[: D21.shape[0] * N, j * q : (j + 1) * q] += direct.reshape(D21.shape[0] * N, q)
        return matrix

    def _moment(
        self, columns: FloatArray | ComplexArray, a: FloatArray, b: FloatArray, constant: bool = False
    ) -> ComplexArray:
        """Integrate ``e^{T(target - s)} columns f(s)`` from a to b, f = 1 or s/h, for every target."""
        half = 0.5 * (b - a)
        s = a[:, None] + half[:, None] * (1.0 + _POINT)
        kernel = self.propagated(self.targets[:, None] - s, columns)
        weight = half[:, None] * _WEIGHT * (1.0 if constant else s / self.length)
        return np.einsum("aq,aqrc->arc", weight, kernel)

    def _through(
        self, column: FloatArray | ComplexArray, a: FloatArray, b: FloatArray, offset: float
    ) -> ComplexArray:
        """Integrate ``e^{T(target - s)} column`` times the interpolation rows at ``s + offset``."""
        half = 0.5 * (b - a)
        s = a[:, None] + half[:, None] * (1.0 + _POINT)
        kernel = self.propagated(self.targets[:, None] - s, column)[..., 0]
        rows = self.rule.rows(2.0 * (s + offset) / self.length - 1.0)
        return np.einsum("aq,aqr,aqn->arn", half[:, None] * _WEIGHT, kernel, rows)

    def _z_rows(self, at_nodes: ComplexArray) -> FloatArray:
        rows = self._to_z.shape[0] * self.rule.size
        return np.einsum("kr,nrc->knc", self._to_z, at_nodes).real.reshape(rows, at_nodes.shape[2])

    def _with_end(self, at_targets: ComplexArray) -> FloatArray:
        end = at_targets[-1]
        return np.vstack([self._z_rows(at_targets[:-1]), end.real, end.imag])
