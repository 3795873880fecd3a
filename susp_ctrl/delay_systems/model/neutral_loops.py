"""Neutral loops, with a direct path from a delayed signal around the loop to itself, and their refusal."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model.folding import FoldedLoop
from susp_ctrl.errors import NeutralLoopError


def refuse_neutral(loop: FoldedLoop) -> None:
    """Raise unless ``det(I - D22 E) = 1`` for all delays: no direct path leads around the loop.

    Only signals that lie on a common cycle of non-zero entries matter, one set of them at a time: a chain of direct
    paths, however large its entries, is no loop.
    """
    D22 = loop.plant.D22
    if not np.any(D22):
        return
    _, component = connected_components(D22 != 0.0, directed=True, connection="strong")
    for k in np.unique(component):
        members = component == k
        if np.any(D22[np.ix_(members, members)]) and _feeds_around(D22[np.ix_(members, members)]):
            raise NeutralLoopError(
                "the loop is neutral: a delayed signal feeds through directly around the loop (for example "
                "delayed acceleration feedback), so no delay is too small to destabilise it; give the channel an "
                "actuator_bandwidth, which makes it retarded"
            )


def _feeds_around(D: FloatArray) -> bool:
    """Tell whether cycles have more weight than rounding.

    The determinant is one for every E exactly when every cycle of D has zero weight, which random points of the
    torus tell apart from any other polynomial in E. Scaling the signals evens the entries and changes no cycle.
    """
    channels = D.shape[0]
    _, (scale, _) = scipy.linalg.matrix_balance(np.abs(D), permute=False, separate=True)
    even = D * scale / scale[:, None]
    phases = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (8, channels))
    determinant = np.linalg.det(np.eye(channels) - even * np.exp(1j * phases)[:, None, :])
    size = np.linalg.det(np.eye(channels) + np.abs(even)) if channels < 12 else 1.0 + np.abs(even).sum()
    return bool(np.any(np.abs(determinant - 1.0) > 1e-12 * max(1.0, abs(size))))
