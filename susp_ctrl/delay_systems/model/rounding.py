r"""What rounding of the data can change: eigenvalues and singularity, entry by entry.

A relative change :math:`\epsilon` of every entry of A moves a simple eigenvalue, with left and right vectors y
and x, by at most

.. math:: |\delta\lambda| \le \epsilon \, \frac{|y|^T |A|\, |x|}{|y^H x|},

and makes a matrix M singular only if :math:`\epsilon \, \rho(|M^{-1}|\,|M|) \ge 1` [1]_. Both follow the local size:
a slow mode beside a fast one keeps its digits, and scaling rows and columns changes nothing.

References
----------
.. [1] N. J. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., SIAM, 2002, chapter 7.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from susp_ctrl.arrays import ComplexArray, FloatArray

_EPSILON = float(np.finfo(float).eps)
# Roundings that go into an entry: folding, balancing and the sums themselves.
_ROUNDINGS = 64.0


def balancing(matrix: FloatArray) -> FloatArray:
    """Return powers of two d for which rows and columns of ``diag(d)^-1 M diag(d)`` are even in size."""
    if matrix.shape[0] == 0:
        return np.ones(0)
    with np.errstate(invalid="ignore"):  # scipy casts the factors to whole numbers as well, and forgets them
        _, (scale, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    return np.asarray(scale)


def rounding_of_sums(terms: int) -> float:
    """Relative rounding error of what is summed from entries that are themselves known to some roundings."""
    return _ROUNDINGS * terms * _EPSILON


def eigenvalues_with_uncertainty(
    matrix: FloatArray, terms: FloatArray | None = None
) -> tuple[ComplexArray, FloatArray]:
    """Return the eigenvalues of a real matrix and how far rounding may move each.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
    terms : ndarray, shape (n, n), optional
        Size of the terms that each entry was summed from; the entries themselves by default.

    Returns
    -------
    values : ndarray of complex, shape (n,)
    uncertainty : ndarray, shape (n,)
    """
    n = matrix.shape[0]
    if n == 0:
        return np.zeros(0, dtype=complex), np.zeros(0)
    decomposed: Any = scipy.linalg.eig(matrix, left=True, right=True)
    values, left, right = decomposed
    overlap = np.abs(np.sum(left.conj() * right, axis=0))
    reach = np.sum(np.abs(left) * ((np.abs(matrix) if terms is None else terms) @ np.abs(right)), axis=0)
    relative = rounding_of_sums(n)
    with np.errstate(all="ignore"):
        uncertain = relative * reach / overlap
    # Where m eigenvalues come together the overlap vanishes, and they move by the m-th root of the change.
    together = np.abs(values[:, None] - values) <= 0.1 * np.abs(values)[:, None] + 1e-3 * reach[:, None]
    number = together.sum(axis=1)
    limit = relative ** (1.0 / number) * np.maximum(reach, np.abs(values))
    return values, np.where(number > 1, np.fmin(uncertain, limit), uncertain)


def distance_to_singular(matrices: np.ndarray) -> FloatArray:
    """Return, up to a factor of the size, the relative change of all entries that makes a matrix singular.

    Parameters
    ----------
    matrices : ndarray, shape (..., n, n)

    Returns
    -------
    ndarray, shape (...)
        Zero for a singular matrix, at most one.
    """
    shape = matrices.shape[:-2]
    result = np.zeros(int(np.prod(shape, dtype=int)))
    for k, matrix in enumerate(matrices.reshape(-1, *matrices.shape[-2:])):
        try:
            with np.errstate(all="ignore"):
                product = np.abs(np.linalg.inv(matrix)) @ np.abs(matrix)
        except np.linalg.LinAlgError:
            continue
        if np.all(np.isfinite(product)):
            result[k] = 1.0 / float(np.abs(np.linalg.eigvals(product)).max(initial=1.0))
    return result.reshape(shape)
