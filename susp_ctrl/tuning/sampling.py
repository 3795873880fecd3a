r"""The controlled plant, sampled once for a whole search.

With P the plant whose tuned paths are cut open (`susp_ctrl.delay_systems.model.lft`), l the vector of road delays and
selected rows only, a search needs

.. math:: h = P_{11} l + P_{12} E (I - P_{22} E)^{-1} P_{21} l, \quad l_k = e^{-j \omega \lambda_k},

one column per frequency: `SampledPlant` with a single input. Frequencies are contiguous in memory here, which
is what makes one swarm step cheap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import Realization, SampledPlant, return_solve, sample_plant
from susp_ctrl.errors import InputError

# Without pivoting an elimination may lose as many digits as its multipliers have.
LARGEST_GROWTH = 100.0


@dataclass(frozen=True, eq=False)
class ControlledPlant:
    """The undelayed plant P of a tuning problem, the names of its signals, and a sample of the box.

    Attributes
    ----------
    gains, delays : ndarray, shape (n, channels)
        Designs for which an objective has to be accurate.
    objectives : tuple
        All that are bound to the plant: those over one band share their frequencies, and so their solves.
    """

    realization: Realization
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    actuators: tuple[str, ...]
    gains: FloatArray
    delays: FloatArray
    objectives: tuple[Any, ...] = ()

    def road_lags(self, lags: Mapping[str, float] | None) -> dict[int, float]:
        """Return {input number: lag in s} for every road input, or say which one is missing.

        Inputs named ``road...`` are the road; where there are none, all inputs that no channel drives.

        Raises
        ------
        InputError
            An unknown input, a road input without lag, or no lags where there are several road inputs.
        """
        roads = [name for name in self.inputs if name.startswith("road")]
        roads = roads or [name for name in self.inputs if name not in self.actuators]
        if lags is None:
            if len(roads) == 1:
                return {self.inputs.index(roads[0]): 0.0}
            raise InputError(
                f"lags = None is not allowed: the plant has {len(roads)} road inputs "
                f"({', '.join(roads)}), give the lag of each in seconds"
            )
        given = {validation.signal_index("lags", name, self.inputs): lag for name, lag in lags.items()}
        missing = [name for name in roads if self.inputs.index(name) not in given]
        if missing:
            raise InputError(
                f"lags has no entry for {missing[0]!r}: every road input needs its lag in seconds"
            )
        return given

    def sample(
        self, omega: FloatArray, rows: Sequence[str], lags: Mapping[str, float] | None, name: str = "weights"
    ) -> SampledPlant:
        """Sample P on jw, reduced to the given outputs and to one road that reaches its inputs one by one.

        Returns
        -------
        SampledPlant
            p11 (f, rows, 1), p12 (f, rows, m), p21 (f, m, 1), p22 (f, m, m); f contiguous in memory.
        """
        r = self.realization
        chosen = [validation.signal_index(name, row, self.outputs) for row in rows]
        entries = self.road_lags(lags)
        columns = list(entries)
        reduced = Realization(
            A=r.A, B1=r.B1[:, columns], B2=r.B2, C1=r.C1[chosen], C2=r.C2,
            D11=r.D11[np.ix_(chosen, columns)], D12=r.D12[chosen], D21=r.D21[:, columns], D22=r.D22,
        )  # fmt: skip
        p = sample_plant(reduced, 1j * omega)
        arrival = np.exp(-1j * omega[:, None] * np.array(list(entries.values())))[:, :, None]
        return SampledPlant(
            *(frequencies_contiguous(block) for block in (p.p11 @ arrival, p.p12, p.p21 @ arrival, p.p22))
        )


def frequencies_contiguous(block: ComplexArray) -> ComplexArray:
    """Return an array (f, rows, columns) with the same values whose first axis is contiguous in memory."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(block, 0, -1)), -1, 0)


def channel_exponentials(gains: FloatArray, delays: FloatArray, omega: FloatArray) -> ComplexArray:
    r"""Return :math:`E_k = g_k e^{-j \omega \tau_k}` for many designs at once.

    Parameters
    ----------
    gains, delays : ndarray, shape (n, m)
    omega : ndarray, shape (f,) or (n, f)

    Returns
    -------
    ndarray of complex, shape (n, f, m)
        Frequencies are contiguous in memory.
    """
    # e^{jx} from u = tan(x/2): ((1 - u2) + 2ju)/(1 + u2), exact to rounding also next to the poles of the
    # tangent; numpy's tangent is several times faster than its sine and cosine, and this is the hot spot.
    u = np.tan(-0.5 * delays.T[:, :, None] * omega)
    square = u * u
    scale = gains.T[:, :, None] / (1.0 + square)
    E = np.empty(u.shape, dtype=complex)
    E.real = (1.0 - square) * scale
    E.imag = 2.0 * u * scale
    return np.moveaxis(E, 0, -1)


def solve_returns(m22: ComplexArray, right_side: ComplexArray) -> ComplexArray:
    """Solve ``(I - M22) X = right_side`` for many designs and frequencies in step.

    Parameters
    ----------
    m22 : ndarray of complex, shape (n, f, m, m)
    right_side : ndarray of complex, shape (f, m, columns)

    Returns
    -------
    ndarray of complex, shape (n, f, m, columns)
        Three signals and more are eliminated in their order, each for all points at once; points where a pivot
        is small beside its column are solved one by one, with pivoting.
    """
    m, columns = right_side.shape[1:]
    if m < 3:
        return np.asarray(return_solve(m22, right_side))
    W = np.empty((m, m + columns, *m22.shape[:2]), dtype=complex)
    W[:, :m] = np.moveaxis(m22, (2, 3), (0, 1))
    W[:, m:] = np.moveaxis(right_side, 0, -1)[:, :, None]
    growth = np.zeros(m22.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for k in range(m):
            pivot = 1.0 - W[k, k]
            W[k, k + 1 :] /= pivot
            if k + 1 < m:
                below = W[k + 1 :, k]
                np.maximum(growth, np.abs(below).max(axis=0) / np.abs(pivot), out=growth)
                W[k + 1 :, k + 1 :] += below[:, None] * W[k, k + 1 :]
        for k in range(m - 1, 0, -1):
            W[:k, m:] += W[:k, k, None] * W[k, m:]
    X = np.moveaxis(W[:, m:], (0, 1), (2, 3))
    design, point = np.nonzero(~(growth < LARGEST_GROWTH))
    if design.size:
        X[design, point] = return_solve(m22[design, point], right_side[point])
    return X
