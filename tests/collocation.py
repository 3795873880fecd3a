r"""Oracle of the time responses: Chebyshev collocation of the whole loop, independent of the marches of the package.

On each interval between kinks the unknowns are the states and the delayed signals at the Chebyshev points
:math:`x_j = -\cos(j \pi/N)`; the derivative is the differentiation matrix [1]_ and one dense system holds
state equation, feed-through and, where a delay is shorter than the interval, the delayed signals inside it. It
shares neither nodes nor coordinates nor the choice of kinks with the package, is slow, and good to about 1e-12.

References
----------
.. [1] L. N. Trefethen, "Spectral Methods in MATLAB", SIAM, 2000, chapter 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.linalg

from susp_ctrl import DelayLTI
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators.input_signals import Inputs, as_inputs
from susp_ctrl.delay_systems.integrators.trajectory import Past, Run
from susp_ctrl.delay_systems.model.folding import FoldedLoop
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.delay_systems.simulation.history import past_of

_DEGREE = 32
_PASSES = 9  # a kink is followed through so many delays: it is then of order 10 at least
_PHASE = 7.0  # largest phase of the fastest mode on half an interval


def simulate(sys: Any, timepts: Any, inputs: Any = None, *, hold: str = "linear", history: Any = None) -> Any:
    """Return outputs, states and inputs of one run, as `susp_ctrl.simulate` takes its arguments."""
    system, times = DelayLTI.of(sys), np.asarray(timepts, dtype=float)
    signals = as_inputs(inputs, system.input_labels, times, hold)
    run = collocated(system.folded, [signals], times, past_of(system, history, signals))
    one = system.noutputs == 1 and system.ninputs <= 1
    return SimpleNamespace(
        outputs=run.outputs[0, :, 0] if one else run.outputs[:, :, 0],
        states=run.states[:, :, 0],
        inputs=run.inputs[:, :, 0],
    )


def collocated(loop: FoldedLoop, inputs: Sequence[Inputs], timepts: FloatArray, past: Past) -> Run:
    """Simulate one folded loop for one or several inputs."""
    plant, delays = loop.plant, loop.delays
    edges = _intervals(plant, delays, inputs, float(timepts[-1]), past)
    nodes = -np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)
    cases, K, n, p = len(inputs), plant.n_channels, plant.n_states, plant.n_outputs
    # signals are sampled inside an interval, where they have one value, and carried to the Chebyshev points
    inner = -np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    carry = np.linalg.inv(_interpolation(nodes, inner))
    coefficients = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, _DEGREE))
    derivative = _differentiation(nodes)
    starts, ends = edges[:-1], edges[1:]
    z = np.zeros((starts.size, K, _DEGREE + 1, cases))
    factors: dict[Any, Any] = {}
    x_start = past.state * np.ones((n, cases))
    outputs, states = np.empty((p, timepts.size, cases)), np.empty((n, timepts.size, cases))
    given = np.empty((plant.n_inputs, timepts.size, cases))
    error, peak = np.zeros((p, cases)), np.zeros((p, cases))
    written = 0
    for i, (a, b) in enumerate(zip(starts, ends, strict=True)):
        half = 0.5 * (b - a)
        times = a + half * (1.0 + inner)
        u = np.stack([signal.at(times) for signal in inputs], axis=-1)
        u = np.einsum("ij,qjc->qic", carry, u)
        w, own = np.zeros((K, _DEGREE + 1, cases)), np.zeros((K, _DEGREE + 1, _DEGREE + 1))
        for k in range(K):
            late = times - delays[k]
            source = np.searchsorted(starts[: i + 1], late, side="right") - 1
            values = np.zeros((_DEGREE + 1, cases))
            for s in np.unique(source):
                rows = np.flatnonzero(source == s)
                if s < 0:
                    if past.delayed is not None:
                        values[rows] = past.delayed(late[rows])[k]
                    continue
                point = 2.0 * (late[rows] - starts[s]) / (ends[s] - starts[s]) - 1.0
                across = _interpolation(nodes, point)
                if s == i:
                    own[k] += carry[:, rows] @ across
                else:
                    values[rows] = across @ z[s, k]
            w[k] = carry @ values
        # rounding decides on which side of the start a node falls that lies one delay after it: intervals of one
        # length need not have one matrix
        key = round(half, 14), own.any(axis=2).tobytes(), own.any(axis=1).tobytes()
        if key not in factors:
            factors[key] = scipy.linalg.lu_factor(_system(plant, derivative, half, own), check_finite=False)
        right_side = np.concatenate(
            [
                half * (np.tensordot(plant.B1, u, axes=1) + np.tensordot(plant.B2, w, axes=1)),
                np.tensordot(plant.D21, u, axes=1) + np.tensordot(plant.D22, w, axes=1),
            ]
        )
        right_side[:n, 0] = x_start
        solution = scipy.linalg.lu_solve(
            factors[key], right_side.reshape(-1, cases), check_finite=False
        ).reshape(n + K, _DEGREE + 1, cases)
        if not np.all(np.isfinite(solution)):
            raise OverflowError(
                f"the response exceeds the range of floating point numbers near t = {a:.6g} s"
            )
        x, z[i] = solution[:n], solution[n:]
        x_start = x[:, -1]
        w += np.einsum("kij,kjc->kic", own, z[i])
        y = (
            np.tensordot(plant.C1, x, axes=1)
            + np.tensordot(plant.D11, u, axes=1)
            + np.tensordot(plant.D12, w, axes=1)
        )
        tail = np.sum(np.abs(np.einsum("ij,pjc->pic", coefficients[-2:], y)), axis=1)
        error, peak = np.maximum(error, tail), np.maximum(peak, np.max(np.abs(y), axis=1, initial=0.0))
        near = b - 1e-12 * max(1.0, abs(b))
        until = timepts.size if i == starts.size - 1 else int(np.searchsorted(timepts, near, side="left"))
        if until > written:
            across = _interpolation(nodes, (timepts[written:until] - a) / half - 1.0)
            for target, signal in ((outputs, y), (states, x), (given, u)):
                target[:, written:until] = np.einsum("ti,sic->stc", across, signal)
            written = until
    return Run(outputs, states, given, error, peak, Past(float(ends[-1]), x_start), starts.size)


def _intervals(
    plant: Realization, delays: FloatArray, inputs: Sequence[Inputs], end: float, past: Past
) -> FloatArray:
    """Edges of the intervals: every kink after up to `_PASSES` delays, and short enough for the fastest mode."""
    kinks = {past.start, *past.kinks}
    for signal in inputs:
        kinks |= {float(t) for t in signal.breakpoints}
        if signal.knots is not None:
            kinks |= {float(t) for t in signal.knots}
    newest = set(kinks)
    distinct = np.unique(delays)
    for _ in range(_PASSES):
        newest = {t + float(d) for t in newest for d in distinct if t + d < end} - kinks
        kinks |= newest
    times = np.array(sorted(t for t in kinks if past.start < t < end))
    edges = np.concatenate([[past.start], times, [max(end, past.start + 1e-9)]])
    # of times equal to rounding the given ones come first: a jump belongs to the interval that it begins
    edges = edges[np.append(True, np.diff(edges) > 1e-12 * max(1.0, abs(end)))]
    edges[-1] = max(end, past.start + 1e-9)
    closed = plant.closed_matrix(np.ones(delays.size, dtype=complex))
    bands = [s.bandwidth for s in inputs if s.bandwidth is not None]
    fastest = max(0.0, *np.abs(plant.eigenvalues), *np.abs(np.linalg.eigvals(closed)), *bands)
    longest = (end - past.start) / 40.0 if len(bands) < len(inputs) else np.inf
    longest = min(longest, 2.0 * _PHASE / fastest) if fastest > 0.0 else longest
    parts = [np.linspace(a, b, max(1, int(np.ceil((b - a) / longest))) + 1)[:-1] for a, b in pairwise(edges)]
    return np.append(np.concatenate(parts), edges[-1])


def _system(plant: Realization, derivative: FloatArray, half: float, own: FloatArray) -> FloatArray:
    """Matrix of the unknowns [x at nodes; z at nodes]; the first node of each state holds the start value."""
    size, n, K = derivative.shape[0], plant.n_states, plant.n_channels
    eye = np.eye(size)
    inside = scipy.linalg.block_diag(*own) if K else np.zeros((0, 0))
    state = np.kron(np.eye(n), derivative) - half * np.kron(plant.A, eye)
    from_delayed = -half * np.kron(plant.B2, eye) @ inside
    first = np.arange(n) * size
    state[first], from_delayed[first] = 0.0, 0.0
    state[first, first] = 1.0
    return np.block(
        [
            [state, from_delayed],
            [-np.kron(plant.C2, eye), np.eye(K * size) - np.kron(plant.D22, eye) @ inside],
        ]
    )


def _differentiation(nodes: FloatArray) -> FloatArray:
    size = nodes.size
    scale = np.ones(size)
    scale[[0, -1]] = 2.0
    scale *= (-1.0) ** np.arange(size)
    matrix = np.outer(scale, 1.0 / scale) / (nodes[:, None] - nodes + np.eye(size))
    return matrix - np.diag(matrix.sum(axis=1))


def _interpolation(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Barycentric interpolation from Chebyshev points of the second kind."""
    weight = (-1.0) ** np.arange(nodes.size)
    weight[[0, -1]] *= 0.5
    gap = points[:, None] - nodes
    hit = np.abs(gap) < 1e-15
    gap[hit] = 1.0
    rows = weight / gap
    rows /= rows.sum(axis=1, keepdims=True)
    exact = np.any(hit, axis=1)
    rows[exact] = hit[exact]
    return rows
