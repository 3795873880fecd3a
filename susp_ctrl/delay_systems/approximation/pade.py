r"""Padé approximation of the delays: an ordinary state-space system beside the exact one.

The diagonal Padé approximation of order n of :math:`e^{-s\tau}` is the all-pass

.. math:: R_n(s) = \prod_k \frac{-(s + p_k)}{s - p_k}, \qquad p_k = 2 q_k/\tau,

with :math:`q_k` the roots of the reverse Bessel polynomial of degree n, which are the poles of the Bessel
filter normalised to unit delay. From polynomial coefficients (their size grows with the factorial of the order)
neither the poles nor the time response survive rounding. Here each pair of poles is one section

.. math:: \frac{\sigma^2 - a\sigma + b}{\sigma^2 + a\sigma + b}, \qquad \sigma = s\tau/2,

realised so that its matrices satisfy :math:`A + A^T + B B^T = 0`. A cascade of such lossless sections is
lossless again, so its norm cannot grow whatever the order, and the time response stays right.

References
----------
.. [1] J. Lam, "Model reduction of delay systems using Padé approximants", Int. J. Control 57(2), 1993.
.. [2] W. E. Thomson, "Delay networks having maximally flat frequency characteristics", Proc. IEE 96, 1949.
"""

from __future__ import annotations

import warnings
from functools import lru_cache

import control
import numpy as np
import scipy.linalg
import scipy.signal
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.approximation.delay_bank import (
    OneDelay,
    Orders,
    at_work,
    channel_orders,
    with_delays_replaced,
)
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.errors import InputError, PadeOrderWarning

HIGHEST_ORDER = 60


def pade_approximation(sys: DelaySystem, order: Orders, omega_max: float | None = None) -> control.StateSpace:
    r"""Replace every delay by its diagonal Padé approximation.

    Parameters
    ----------
    sys : DelayLTI
        System with exact delays.
    order : int or sequence of int, shape (n_delays,)
        Order for all delays, or one for each of ``sys.delays``; 1 to 60. A delay of zero or without effect
        needs no approximation and adds no states.
    omega_max : float, optional
        Highest frequency (rad/s) that matters; a warning is given where the order is too low for it.

    Returns
    -------
    control.StateSpace
        Inputs and outputs as in `sys` (one ``idle`` input if it has none); its states are those of `sys`, then
        `order` for each delayed signal.

    Raises
    ------
    InputError
        An order outside 1 to 60, or not one for each delay.

    Warns
    -----
    PadeOrderWarning
        A delay whose phase error at `omega_max` exceeds 0.01 rad; the message names the order needed.

    Notes
    -----
    About ``omega tau / 2 + 4`` is needed up to the frequency omega. Lower orders are wrong in both directions:
    stable loops can appear unstable and unstable ones stable. Eigenvalues far to the left, where ``|e^{-s tau}|``
    exceeds 1e12, are those of rounding.
    """
    sys = DelaySystem.of(sys, "sys")
    orders = channel_orders(sys, order, HIGHEST_ORDER)
    if omega_max is not None:
        _warn_if_low(sys, orders, validation.number("omega_max", omega_max, above=0.0))
    return with_delays_replaced(sys, orders, pade_cascade, "pade")


def pade_order(sys: DelaySystem, omega_max: float, tolerance: float = 1e-2) -> int:
    """Return the lowest order whose all-pass phase error stays below a tolerance up to a frequency.

    Parameters
    ----------
    sys : DelayLTI
        System with exact delays; its largest delay at work decides.
    omega_max : float
        Upper end of the band (rad/s).
    tolerance : float, optional
        Largest phase error (rad) of a delay in the band, which is also the error of ``e^{-j omega tau}``.

    Returns
    -------
    int
        At least 1; about ``omega_max * tau / 2 + 4``.

    Raises
    ------
    InputError
        A band or tolerance that is not positive, or an order above 60 would be needed.

    Notes
    -----
    The phase error grows with frequency, so that the band's end decides: the group delay of the approximation
    falls short of tau by ``tau x^{2n}/|theta_n(jx)|^2 > 0``, ``x = omega tau/2``, with the reverse Bessel
    polynomial ``theta_n``.
    """
    omega = validation.number("omega_max", omega_max, above=0.0)
    allowed = validation.number("tolerance", tolerance, above=0.0)
    sys = DelaySystem.of(sys, "sys")
    longest = float(np.max(sys.channel_delays[at_work(sys)], initial=0.0))
    needed = _order_needed(omega * longest, allowed)
    if needed is None:
        raise InputError(
            f"omega_max = {omega:g} with a delay of {longest:g} s needs a Padé order above {HIGHEST_ORDER}: "
            "a lower omega_max or an exact method is needed"
        )
    return needed


def pade_phase_error(order: int, angle: ArrayLike) -> FloatArray:
    """Return the phase of the Padé all-pass minus that of the delay, at ``angle = omega * tau`` (rad).

    Parameters
    ----------
    order : int
        Order of the approximation.
    angle : array_like
        ``omega * tau`` in radians, not negative.

    Returns
    -------
    ndarray
        Positive: the approximation turns too little. Zero for the exact delay.
    """
    x = np.asarray(angle, dtype=float) / 2.0
    damping, stiffness = _sections(order)
    turned = 2.0 * np.arctan2(damping * x[..., None], stiffness - x[..., None] ** 2).sum(axis=-1)
    if order % 2:
        turned = turned + 2.0 * np.arctan2(x, _real_pole(order))
    return np.asarray(2.0 * x - turned)


def pade_cascade(order: int, delay: float) -> OneDelay:
    """Return the Padé all-pass of one delay (s, positive) as a cascade of lossless real sections; its D is ``+-1``."""
    A, B, C, D = _unit_cascade(order)
    rate = 2.0 / delay
    return OneDelay(A * rate, B[:, None] * rate, C[None, :], np.array([[D]]))


@lru_cache(maxsize=128)
def _unit_cascade(order: int) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """The cascade in scaled time ``sigma = s tau/2``; the signal runs from the last states to the first.

    In this order A is upper quasi-triangular, so that an eigenvalue solver finds the poles in its diagonal
    blocks: the poles of a lossless system are otherwise as sensitive to rounding as those of its polynomial.
    """
    damping, stiffness = _sections(order)
    A, B, C = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    D, first = 1.0, order
    if order % 2:
        # (p - sigma)/(p + sigma)
        pole, first = _real_pole(order), order - 1
        A[first, first], B[first], C[first], D = -pole, np.sqrt(2.0 * pole), np.sqrt(2.0 * pole), -1.0
    for a, b in zip(damping, stiffness, strict=True):
        # 1 - 2 a sigma/(sigma^2 + a sigma + b), driven by the output of the sections before it
        root, weight, before, first = np.sqrt(b), np.sqrt(2.0 * a), slice(first, order), first - 2
        A[first, first + 1], A[first + 1, first], A[first + 1, first + 1] = root, -root, -a
        A[first + 1, before], B[first + 1] = weight * C[before], weight * D
        C[first + 1] = -weight
    for array in (A, B, C):
        array.setflags(write=False)
    return A, B, C, D


@lru_cache(maxsize=128)
def _bessel_poles(order: int) -> np.ndarray:
    return np.asarray(scipy.signal.besselap(order, norm="delay")[1])


def _sections(order: int) -> tuple[FloatArray, FloatArray]:
    """Coefficients a, b of the second-order factors ``sigma^2 + a sigma + b``."""
    pairs = _bessel_poles(order)
    upper = pairs[pairs.imag > 1e-6]
    return -2.0 * upper.real, np.abs(upper) ** 2


def _real_pole(order: int) -> float:
    poles = _bessel_poles(order)
    return -float(poles[np.argmin(np.abs(poles.imag))].real)


def _order_needed(angle: float, tolerance: float) -> int | None:
    for order in range(1, HIGHEST_ORDER + 1):
        if pade_phase_error(order, angle) <= tolerance:
            return order
    return None


def _warn_if_low(sys: DelaySystem, orders: np.ndarray, omega: float) -> None:
    for n, tau in zip(orders, sys.channel_delays, strict=True):
        if n and pade_phase_error(int(n), omega * tau) > 1e-2:
            needed = _order_needed(omega * tau, 1e-2) or f"more than {HIGHEST_ORDER}"
            warnings.warn(
                f"Padé order {n} is too low for a delay of {tau:g} s up to {omega:g} rad/s: {needed} is needed",
                PadeOrderWarning,
                stacklevel=3,
            )
            return
