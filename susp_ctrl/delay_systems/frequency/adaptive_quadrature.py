"""Adaptive Gauss-Kronrod quadrature of vectorised functions, all intervals of a round in one evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl.arrays import FloatArray

# Abscissae and weights of the 7-point Gauss, 15-point Kronrod rule (QUADPACK, qk15).
_NODES = np.array(
    [
        0.991455371120812639206854697526329,
        0.949107912342758524526189684047851,
        0.864864423359769072789712788640926,
        0.741531185599394439863864773280788,
        0.586087235467691130294144691693013,
        0.405845151377397166906606412076961,
        0.207784955007898467600689403773245,
        0.0,
    ]
)
_KRONROD = np.array(
    [
        0.022935322010529224963732008058970,
        0.063092092629978553290700663189204,
        0.104790010322250183839876322541518,
        0.140653259715525918745189590510238,
        0.169004726639267902826583426598550,
        0.190350578064785409913256402421014,
        0.204432940075298892414161999234649,
        0.209482141084727828012999174891714,
    ]
)
_GAUSS = np.array(
    [
        0.129484966168869693270611432679082,
        0.279705391489276667901467771423780,
        0.381830050505118944950369775488975,
        0.417959183673469387755102040816327,
    ]
)
_MOST_INTERVALS = 200_000


class Integral(NamedTuple):
    """Integrals of all components, and a safe estimate of their errors relative to value or scale."""

    value: FloatArray
    relative_error: FloatArray


def integrate(
    function: Callable[[FloatArray], FloatArray],
    low: float,
    high: float,
    relative: float,
    knots: ArrayLike = (),
    scale: ArrayLike = 0.0,
    most: int = _MOST_INTERVALS,
) -> Integral:
    """Integrate a function of one variable whose last axis runs over the points.

    Parameters
    ----------
    function : callable
        ``x (n,) -> (..., n)``.
    low, high : float
        Ends.
    relative : float
        Error wanted, relative to the integral (or to `scale` where that is larger) of every component.
    knots : array_like, optional
        Where to divide at first.
    scale : array_like, optional
        Size of the result beside which the error counts.
    most : int, optional
        Intervals to evaluate at most.

    Returns
    -------
    Integral
        Arrays of the shape of the components. The relative error is larger than asked where `most` intervals were
        not enough.
    """
    inner = np.asarray(knots, dtype=float)
    edges = np.unique(np.concatenate([np.linspace(low, high, 9), inner[(inner > low) & (inner < high)]]))
    a, b = edges[:-1], edges[1:]
    x = np.concatenate([-_NODES[:-1], _NODES[::-1]])
    kronrod = np.concatenate([_KRONROD[:-1], _KRONROD[::-1]])
    gauss = np.zeros(15)
    gauss[1::2] = np.concatenate([_GAUSS[:-1], _GAUSS[::-1]])
    done: FloatArray | float = 0.0
    missed: FloatArray | float = 0.0
    used = 0
    while True:
        used += a.size
        centre, half = 0.5 * (a + b), 0.5 * (b - a)
        points = centre[:, None] + half[:, None] * x
        values = np.asarray(function(points.ravel()))
        values = values.reshape(*values.shape[:-1], a.size, 15)
        fine, error = (values @ kronrod) * half, np.abs(values @ (kronrod - gauss)) * half
        total = np.asarray(done + fine.sum(axis=-1))
        # the rule's own error is far below the difference of the two rules, which serves as a safe estimate
        # by the share of the band, but a narrow peak need not be better than all the others together
        share = np.maximum(half / (0.5 * (high - low)), 0.1 / a.size)
        allowed = 0.5 * relative * np.maximum(np.abs(total), scale)[..., None] * share
        rough = error > np.maximum(allowed, 1e-15 * np.abs(fine))
        bad = np.any(rough.reshape(-1, a.size), axis=0)
        size = np.maximum(np.abs(total), scale)
        # enough if all errors together are small, however uneven
        enough = not np.any(bad) or np.all(error.sum(axis=-1) <= 0.1 * relative * size)
        if enough or used + 2 * np.count_nonzero(bad) > most:
            left = missed + error.sum(axis=-1)
            return Integral(total, np.divide(left, size, out=np.zeros_like(total), where=size > 0.0))
        done = done + fine[..., ~bad].sum(axis=-1)
        missed = missed + error[..., ~bad].sum(axis=-1)
        a, b = np.concatenate([a[bad], centre[bad]]), np.concatenate([centre[bad], b[bad]])
