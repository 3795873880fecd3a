"""Random systems with state delays by families, for tests of verdicts."""

from __future__ import annotations

import numpy as np

import susp_ctrl as sc

FAMILIES = (
    "plain", "scaled", "slow and fast", "commensurate", "equal", "zero and short", "integrator",
    "defective", "many unstable", "near critical", "large", "long and short",
)  # fmt: skip


def random_system(family, seed):
    """Return A = [A0, A1, ...] and the delays."""
    rng = np.random.default_rng([FAMILIES.index(family), seed])
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    if family == "large":
        n, m = int(rng.integers(7, 13)), int(rng.integers(2, 6))
    sparse = rng.choice([0.4, 0.8, 1.0])
    A = [rng.normal(size=(n, n)) * (rng.random((n, n)) < sparse) for _ in range(m + 1)]
    weight = 10.0 ** rng.uniform(-1.5, 0.3)
    A[1:] = [weight * matrix for matrix in A[1:]]
    A[0] -= rng.uniform(0.0, 4.0) * np.eye(n)
    tau = 10.0 ** rng.uniform(-1.0, 0.5, m)
    if family == "commensurate":
        tau = rng.uniform(0.1, 1.0) * rng.integers(1, 5, m)
    elif family == "equal":
        tau[:] = tau[0]
    elif family == "zero and short":
        tau = np.where(rng.random(m) < 0.5, 0.0, 10.0 ** rng.uniform(-6, -2, m))
    elif family == "long and short":
        tau = 10.0 ** rng.uniform(-3, 1.5, m)
    elif family == "slow and fast":
        A[0] -= np.diag(10.0 ** rng.uniform(-3, 4, n))
    elif family == "integrator":
        A[0][:, 0] = 0.0
    elif family == "defective":
        A[0] = -rng.uniform(0.1, 2.0) * np.eye(n) + np.diag(np.ones(n - 1), 1)
        A[1:] = [0.3 * np.triu(matrix) for matrix in A[1:]]
    elif family == "many unstable":
        A, tau = [0.2 * np.eye(n) @ A[0], *A[1:]], 10.0 ** rng.uniform(0.5, 1.3, m)
    elif family == "near critical":
        A = _near_critical(A, tau, rng)
    if family == "scaled":
        units, second = 10.0 ** rng.uniform(-8, 8, n), 10.0 ** rng.uniform(-5, 5)
        A, tau = [matrix * units[:, None] / units / second for matrix in A], tau * second
    return A, tau


def _near_critical(A, tau, rng):
    """Move all roots sideways until the rightmost one is 1e-9 of its size from the axis, on either side."""
    root = sc.characteristic_roots(sc.DelayLTI.from_state_delays(A, tau), 1)[0]
    shift = root.real - rng.choice([-1e-9, 1e-9]) * max(abs(root), 1.0)
    eye = np.eye(A[0].shape[0])
    return [A[0] - shift * eye, *(m * np.exp(-shift * d) for m, d in zip(A[1:], tau, strict=True))]
