"""Independent oracles of ``x'(t) = A[0] x(t) + sum A[k] x(t - tau[k])``: nothing of the package is used.

* `full_state_roots`: Chebyshev collocation of the whole state on the longest delay (Breda, Maset, Vermiglio,
  SIAM J. Sci. Comput. 27(2), 2005), a different discretisation from the one under test, which has one line for
  each delayed signal;
* `dense_contour_count`: the phase of the determinant on a fixed, very dense grid of a large half circle.

Random systems for the property tests: `random_loop`, and `shifted`, which moves all roots by a known distance.
"""

from __future__ import annotations

import numpy as np


def random_loop(seed):
    """A[0], A[1], ... and the delays: 1 to 6 states, 1 to 3 incommensurate delays of any rank, stable and unstable.

    One in ten has no undelayed part.
    """
    random = np.random.default_rng(seed)
    n, m = random.integers(1, 7), random.integers(1, 4)
    rate = 10.0 ** random.uniform(-1.0, 1.0)
    A0 = rate * (random.normal(size=(n, n)) - random.choice([0.0, 1.0, 3.0]) * np.eye(n))
    A = [A0 * (random.random() > 0.1)]
    for _ in range(m):
        rank = random.integers(1, n + 1)
        factor = rate * 10.0 ** random.uniform(-1.0, 0.4) / np.sqrt(n * rank)
        A.append(factor * random.normal(size=(n, rank)) @ random.normal(size=(rank, n)))
    return A, 10.0 ** random.uniform(-1.5, 0.8, m) / rate


def shifted(A, delays, shift):
    """The same loop with every root moved by `shift` to the left, exactly: s -> s + shift."""
    moved = [A[0] - shift * np.eye(len(A[0]))]
    return moved + [a * np.exp(-shift * tau) for a, tau in zip(A[1:], delays, strict=True)]


def characteristic_matrix(A, delays, s):
    """sI - A0 - sum A_k e^{-s tau_k}, shape s.shape + (n, n)."""
    s = np.asarray(s, dtype=complex)[..., None, None]
    K = s * np.eye(len(A[0])) - np.asarray(A[0], dtype=float)
    for matrix, tau in zip(A[1:], delays, strict=True):
        K = K - np.asarray(matrix, dtype=float) * np.exp(-s * tau)
    return K


def full_state_roots(A, delays, order):
    """Eigenvalues of the infinitesimal generator, discretised at order + 1 Chebyshev points."""
    A = [np.asarray(a, dtype=float) for a in A]
    n, longest = len(A[0]), max(delays)
    x = np.cos(np.pi * np.arange(order + 1) / order)
    c = np.r_[2.0, np.ones(order - 1), 2.0] * (-1.0) ** np.arange(order + 1)
    dx = x[:, None] - x
    D = np.outer(c, 1.0 / c) / (dx + np.eye(order + 1))
    D -= np.diag(D.sum(axis=1))
    generator = np.kron(D * 2.0 / longest, np.eye(n))
    generator[:n] = 0.0
    generator[:n, :n] = A[0]
    weights = np.r_[0.5, np.ones(order - 1), 0.5] * (-1.0) ** np.arange(order + 1)
    for matrix, tau in zip(A[1:], delays, strict=True):
        distance = (1.0 - 2.0 * tau / longest) - x  # barycentric interpolation at theta = -tau
        if np.any(np.abs(distance) < 1e-13):
            row = (np.abs(distance) < 1e-13).astype(float)
        else:
            row = weights / distance
            row /= row.sum()
        generator[:n] += np.kron(row, matrix)
    eigenvalues = np.linalg.eigvals(generator)
    return eigenvalues[np.argsort(-eigenvalues.real)]


def dense_contour_count(A, delays):
    """Roots with positive real part: turns of the determinant around a half disc that holds them all.

    Blind where several roots together lie nearer to the axis than the grid is fine (A[0] = 0 with A[1] of lower
    rank has some at s = 0): not to be asked of such systems.
    """
    radius = 1.1 * sum(np.linalg.norm(a, 2) for a in A) + 1.0
    points = int(20_000 + 100 * radius * max(delays))
    while points < 2_000_000:
        axis = 1j * np.linspace(radius, -radius, points)
        arc = radius * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, points))
        s = np.concatenate([axis, arc])
        values = np.linalg.slogdet(characteristic_matrix(A, delays, s))[0]
        steps = np.angle(values[1:] / values[:-1])
        if np.max(np.abs(steps)) < 1.0:
            return round(steps.sum() / (2.0 * np.pi))
        points *= 4
    raise AssertionError("a root is too near to the axis for this oracle")
