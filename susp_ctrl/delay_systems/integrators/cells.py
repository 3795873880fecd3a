r"""One cell of the time axis: the plant's exact response to polynomial forcing.

On a cell of length h every signal is the polynomial through its values at N Gauss nodes. In coordinates in which
A is diagonal (or, where the eigenvectors are badly conditioned, triangular: Schur form) the state equation is a
sequence of scalar ones,

.. math:: \xi_i' = t_{ii} \xi_i + \phi_i(t), \qquad \Xi_i = (I - \tfrac{h}{2} t_{ii} S)^{-1}
          (\xi_i(0) \mathbf 1 + \tfrac{h}{2} S \Phi_i),

with the spectral integration matrix S: Gauss collocation, A-stable and of order 2N at the cell's end [1]_.

References
----------
.. [1] E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 2nd ed., Springer, 1996, chapter IV.5.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.polynomial import legendre

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import Realization, balancing

# Eigenvector matrices worse conditioned than this lose too many digits; the Schur form takes their place.
_EIGENVECTOR_CONDITION = 1e5
_JUMP = 0.03  # part of a signal's range in a cell that the two highest coefficients are where it jumps


class GaussRule:
    """Gauss-Legendre nodes on [-1, 1] and what polynomials through them need.

    Parameters
    ----------
    size : int
        Number of nodes N.

    Attributes
    ----------
    nodes, weights : ndarray, shape (N,)
        Nodes and quadrature weights.
    to_coefficients : ndarray, shape (N, N)
        Values at the nodes to Legendre coefficients.
    integration : ndarray, shape (N, N)
        Values at the nodes to the integral from -1 to each node.
    truncation : ndarray, shape (N, N)
        Values at the nodes to values of the polynomial without its two highest coefficients.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.nodes, self.weights = legendre.leggauss(size)
        vandermonde = legendre.legvander(self.nodes, size)
        degree = np.arange(size)
        self.to_coefficients = (degree[:, None] + 0.5) * vandermonde[:, :size].T * self.weights
        antiderivative = np.zeros((size + 1, size))
        antiderivative[0, 0] = 1.0
        antiderivative[degree + 1, degree] = 1.0 / (2 * degree + 1)
        antiderivative[degree[1:] - 1, degree[1:]] -= 1.0 / (2 * degree[1:] + 1)
        self.integration = vandermonde @ antiderivative @ self.to_coefficients
        self._barycentric = (-1.0) ** degree * np.sqrt((1.0 - self.nodes**2) * self.weights)
        self.truncation = vandermonde[:, : size - 2] @ self.to_coefficients[: size - 2]

    def rows(self, points: FloatArray) -> FloatArray:
        """Rows that interpolate node values at points of [-1, 1], shape (*points.shape, N).

        A point that rounding puts outside is the end: seen from a cell of a few roundings it can be far away.
        """
        rows = np.clip(points, -1.0, 1.0)[..., None] - self.nodes
        # at a node its own weight outgrows all others and the row becomes that of the identity
        rows[rows == 0.0] = 1e-290
        np.divide(self._barycentric, rows, out=rows)
        rows /= rows.sum(axis=-1, keepdims=True)
        return rows

    def companion(self, signal: FloatArray, jumps: bool = False) -> FloatArray:
        """Return node values, shape (..., N, cells, columns), without the two highest coefficients.

        Where there may be `jumps`, a cell whose coefficients do not decay becomes its first value: its highest
        coefficients have no integral, so that leaving them out would show nothing.
        """
        *before, cells, columns = signal.shape
        flat = signal.reshape(*before, cells * columns)
        lower = (self.truncation @ flat).reshape(signal.shape)
        if not jumps:
            return lower
        tail = np.sum(np.abs(self.to_coefficients[-2:] @ flat), axis=-2)
        tail = tail.reshape(*before[:-1], 1, cells, columns)
        rough = tail > _JUMP * np.ptp(signal, axis=-3, keepdims=True)
        return np.where(rough, signal[..., :1, :, :], lower)

    def phase_resolved(self, tolerance: float) -> float:
        """Return the largest theta whose ``e^{j theta x}`` on [-1, 1] is resolved to a relative tolerance."""
        n = self.size
        return 2.0 * n / math.e * (tolerance / np.sqrt(n)) ** (1.0 / n)


@lru_cache(maxsize=16)
def gauss_rule(size: int) -> GaussRule:
    """Return the rule with `size` nodes, made once."""
    return GaussRule(size)


class PlantCoordinates:
    """The plant in coordinates in which A is diagonal or triangular.

    Attributes
    ----------
    T : ndarray of complex, shape (r, r)
        Diagonal or triangular matrix. Of each conjugate pair of a diagonal form one half is kept, doubled in
        `back`, and every real signal is the real part of what comes out.
    diagonal : bool
        Whether T is diagonal.
    B1, B2 : ndarray of complex
        Input matrices in these coordinates.
    back : ndarray of complex, shape (n, r)
        ``x = Re(back @ xi)``.
    into : ndarray of complex, shape (r, n)
        ``xi = into @ x``.
    """

    def __init__(self, plant: Realization) -> None:
        n = plant.n_states
        scale = balancing(plant.A)
        balanced = plant.A / scale[:, None] * scale
        values, vectors = np.linalg.eig(balanced) if n else (np.zeros(0), np.zeros((0, 0)))
        self.diagonal = n == 0 or np.linalg.cond(vectors) < _EIGENVECTOR_CONDITION
        if self.diagonal:
            kept = values.imag >= 0.0
            inverse = np.linalg.inv(vectors) if n else np.zeros((0, 0))
            weight = np.where(values.imag > 0.0, 2.0, 1.0)[kept]
            self.T = np.diag(values[kept]).astype(complex)
            self.back = (scale[:, None] * vectors[:, kept] * weight).astype(complex)
            self.into = (inverse[kept] / scale).astype(complex)
        else:
            T, Q = scipy.linalg.schur(balanced, output="complex")
            self.T = T
            self.back = scale[:, None] * Q
            self.into = Q.conj().T / scale
        self.B1 = self.into @ plant.B1
        self.B2 = self.into @ plant.B2

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.T.shape[0]


class CellResponse:
    """Response of the plant's coordinates on cells of one length.

    Parameters
    ----------
    coordinates : PlantCoordinates
        The plant.
    rule : GaussRule
        Nodes.
    length : float
        Length of the cell in seconds.
    """

    def __init__(self, coordinates: PlantCoordinates, rule: GaussRule, length: float) -> None:
        self._T, self._diagonal = coordinates.T, coordinates.diagonal
        half = 0.5 * length
        poles = np.diag(self._T)
        eye = np.eye(rule.size)
        right_side = np.hstack([half * rule.integration, np.ones((rule.size, 1))])
        solution = np.linalg.solve(
            eye - (half * poles)[:, None, None] * rule.integration,
            np.broadcast_to(right_side, (poles.size, *right_side.shape)).astype(complex),
        )
        self.forced = np.ascontiguousarray(solution[:, :, :-1])
        self.free = np.ascontiguousarray(solution[:, :, -1])
        # xi(end) = xi(0) + half * weights . (pole * Xi + Phi)
        self.end_forced = half * (poles[:, None] * (rule.weights @ self.forced) + rule.weights)
        self.end_free = 1.0 + half * poles * (self.free @ rule.weights)

    def respond(self, forcing: ComplexArray, start: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the coordinates at the nodes and at the end.

        Parameters
        ----------
        forcing : ndarray of complex, shape (r, N, columns)
            Forcing of each coordinate at the nodes.
        start : ndarray of complex, shape (r, columns)
            Coordinates at the start.

        Returns
        -------
        nodes : ndarray of complex, shape (r, N, columns)
        end : ndarray of complex, shape (r, columns)
        """
        if self._diagonal:
            at_nodes = self.forced @ forcing + self.free[:, :, None] * start[:, None, :]
            end = (self.end_forced[:, None, :] @ forcing)[:, 0] + self.end_free[:, None] * start
            return at_nodes, end
        at_nodes, end = np.empty_like(forcing), np.empty_like(start)
        for i in range(self._T.shape[0] - 1, -1, -1):
            phi = forcing[i] + np.tensordot(self._T[i, i + 1 :], at_nodes[i + 1 :], axes=1)
            at_nodes[i] = self.forced[i] @ phi + self.free[i, :, None] * start[i]
            end[i] = self.end_forced[i] @ phi + self.end_free[i] * start[i]
        return at_nodes, end


class CellOperator(NamedTuple):
    """The loop on cells of one length, for the march from cell to cell.

    With the delayed signals from earlier cells ``w`` (channels * N) and the coordinates at the start
    ``[Re xi; Im xi]``, ``[z; Re xi(end); Im xi(end)] = march @ [w; Re xi; Im xi] + march_input``, delays shorter
    than the cell included. ``own`` interpolates z at t - tau inside the cell.
    """

    response: CellResponse
    march: FloatArray
    own: FloatArray | None
    input_to_march: FloatArray | None


def cell_operator(
    plant: Realization, delays: FloatArray, coordinates: PlantCoordinates, rule: GaussRule, length: float
) -> CellOperator:
    """Return the operator of cells of a given length.

    Parameters
    ----------
    plant : Realization
        Folded plant.
    delays : ndarray, shape (channels,)
        Positive delays in seconds.
    coordinates : PlantCoordinates
        The same plant in diagonal or triangular form.
    rule : GaussRule
        Nodes.
    length : float
        Length in seconds.
    """
    response = CellResponse(coordinates, rule, length)
    K, N, r = plant.n_channels, rule.size, coordinates.size
    columns = K * N + 2 * r
    forcing = np.zeros((r, N, columns), dtype=complex)
    for k in range(K):
        nodes = np.arange(N)
        forcing[:, nodes, k * N + nodes] = coordinates.B2[:, [k]]
    start = np.hstack([np.zeros((r, K * N)), np.eye(r), 1j * np.eye(r)])
    at_nodes, end = response.respond(forcing, start)
    z = np.real(np.tensordot(plant.C2 @ coordinates.back, at_nodes, axes=1)).reshape(K * N, columns)
    z[:, : K * N] += np.kron(plant.D22, np.eye(N))
    march = np.vstack([z, end.real, end.imag])
    if not np.any(delays < length):
        return CellOperator(response, march, None, None)
    # w = (earlier cells) + own @ z, so the z of the cell stands on both sides
    own = np.zeros((K * N, K * N))
    for k in range(K):
        point = rule.nodes - 2.0 * delays[k] / length
        inside = np.flatnonzero(point > -1.0)
        own[k * N + inside, k * N : (k + 1) * N] = rule.rows(point[inside])
    feedback = march[:, : K * N] @ own
    solved = np.linalg.solve(np.eye(K * N) - feedback[: K * N], np.eye(K * N))
    # v = [z; xi]: v = march s + march_input + feedback z,  z = solved (march s + march_input)_z
    correction = np.eye(columns)
    correction[:, : K * N] += feedback @ solved
    return CellOperator(response, correction @ march, own, correction)
