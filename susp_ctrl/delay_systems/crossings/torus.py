r"""Two scalar delayed signals: the characteristic equation on the torus ``|z1| = |z2| = 1``.

With two channels the characteristic function at :math:`s = j\omega` is bilinear,

.. math:: \det(I - P\,\mathrm{diag}(z_1, z_2)) = p_0 + p_1 z_1 + p_2 z_2 + p_{12} z_1 z_2,\qquad
    z_k = e^{-j\theta_k}, \quad \theta_k = \omega\tau_k.

Eliminating :math:`z_2` leaves :math:`|p_0 + p_1 z_1| = |p_2 + p_{12} z_1|`, which is

.. math:: c + 2\,\mathrm{Re}(q z_1) = 0, \quad c = |p_0|^2 + |p_1|^2 - |p_2|^2 - |p_{12}|^2, \quad
    q = \bar p_0 p_1 - \bar p_2 p_{12},

and has the two solutions :math:`z_1 = e^{j(\pm\arccos(-c/2|q|) - \arg q)}` where :math:`|c| \le 2|q|`. The
crossing curves in the plane of the delays are closed form in the frequency [1]_.

References
----------
.. [1] K. Gu, S.-I. Niculescu, J. Chen, "On stability crossing curves for general systems with two delays",
   J. Math. Anal. Appl. 311, 2005. Here with the cross term.
.. [2] J. C. Doyle, "Analysis of feedback systems with structured uncertainties", IEE Proc. D 129, 1982: for two
   blocks the scaled norm is the structured singular value.
"""

from __future__ import annotations

import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray


def bilinear_coefficients(p22: ComplexArray) -> ComplexArray:
    """Return ``p0, p1, p2, p12`` of ``det(I - P22 diag(z1, z2))``; shape (4, ...)."""
    a, d = p22[..., 0, 0], p22[..., 1, 1]
    return np.stack([np.ones_like(a), -a, -d, a * d - p22[..., 0, 1] * p22[..., 1, 0]])


def torus_excess(coefficients: ComplexArray, coupling: FloatArray) -> FloatArray:
    """Return a number that is not negative exactly where there are solutions.

    ``4|q|^2 - c^2`` equals ``4 kappa^2 - d^2`` with ``kappa = |p0 p12 - p1 p2| = |P12 P21|`` (the `coupling`) and
    ``d = |p1|^2 + |p2|^2 - |p0|^2 - |p12|^2``: for channels that are hardly coupled only this keeps digits.
    """
    return (2.0 * coupling - np.abs(_difference(coefficients))) / np.sum(np.abs(coefficients) ** 2, axis=0)


def torus_solutions(coefficients: ComplexArray, coupling: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angles of both solutions.

    Parameters
    ----------
    coefficients : ndarray of complex, shape (4, ...)
        ``p0, p1, p2, p12``.
    coupling : ndarray, shape (...)
        ``|p0 p12 - p1 p2|``, formed without cancellation.

    Returns
    -------
    theta1, theta2 : ndarray, shape (2, ...)
        Angles in (-pi, pi] of the + and the - solution; nan where there is none.
    """
    p0, p1, p2, p12 = coefficients
    c = np.abs(p0) ** 2 + np.abs(p1) ** 2 - np.abs(p2) ** 2 - np.abs(p12) ** 2
    q = p0.conj() * p1 - p2.conj() * p12
    d = np.abs(_difference(coefficients))
    # At the end of a curve, found to rounding, the two solutions are one.
    room = np.where(np.abs(2.0 * coupling - d) <= 1e-15, 0.0, 2.0 * coupling - d)
    with np.errstate(all="ignore"):
        half = np.arctan2(np.sqrt(room * (2.0 * coupling + d)), -c)
        z1 = np.exp(1j * (np.stack([half, -half]) - np.angle(q)))
        z2 = -(p0 + p1 * z1) / (p2 + p12 * z1)
    return -np.angle(z1), -np.angle(z2)


def structured_gain(p22: ComplexArray) -> FloatArray:
    r"""Return the largest spectral radius of ``P diag(z1, z2)`` over the torus: exact for two scalar channels.

    The structured singular value of two scalar blocks equals the least scaled norm
    :math:`\min_d \bar\sigma(\mathrm{diag}(d,1) P \mathrm{diag}(d,1)^{-1})`. The determinant does not depend on
    the scaling, so the least Frobenius norm gives the least :math:`\bar\sigma`, in closed form.
    """
    a, d = p22[..., 0, 0], p22[..., 1, 1]
    around = p22[..., 0, 1] * p22[..., 1, 0]
    frobenius = np.abs(a) ** 2 + np.abs(d) ** 2 + 2.0 * np.abs(around)
    det = np.abs(a * d - around) ** 2
    return np.sqrt(0.5 * (frobenius + np.sqrt(np.maximum(frobenius**2 - 4.0 * det, 0.0))))


def _difference(coefficients: ComplexArray) -> FloatArray:
    p0, p1, p2, p12 = np.abs(coefficients) ** 2
    return p1 + p2 - p0 - p12
