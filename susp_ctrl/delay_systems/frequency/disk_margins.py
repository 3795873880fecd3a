r"""The disk margin: how much gain and phase may change together before a closed loop with delays becomes unstable.

Each channel of the loop is multiplied by a factor from the disk

.. math:: f = \frac{1 + \frac{1 - \sigma}{2} \delta}{1 - \frac{1 + \sigma}{2} \delta}, \qquad |\delta| < \alpha,

and the loop stays stable for all of them as long as :math:`\alpha \, \|S + \frac{\sigma - 1}{2} I\|_\infty \le 1`
with the sensitivity S; for the balanced disk, skew zero, this is :math:`\frac12 (S - T)`.

References
----------
.. [1] P. Seiler, A. Packard, P. Gahinet, "An introduction to disk margins", IEEE Control Systems Magazine 40(5), 2020.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.delay_systems.frequency.norms import hinf_norm
from susp_ctrl.delay_systems.model import DelaySystem, arithmetic
from susp_ctrl.errors import InputError


@dataclass(frozen=True)
class DiskMargin:
    """Gain and phase that a closed loop bears together, in every channel.

    Attributes
    ----------
    margin : float
        Radius alpha of the disk.
    gain_range : (float, float)
        Real factors in the disk.
    phase_margin : float
        Angle (rad) up to which the loop may turn alone; inf if any.
    omega : float
        Frequency (rad/s) at which the disk is reached.
    """

    margin: float
    gain_range: tuple[float, float]
    phase_margin: float
    omega: float

    @property
    def phase_margin_deg(self) -> float:
        """The phase margin in degrees."""
        return float(np.degrees(self.phase_margin))


def disk_margin(sys: Any, skew: float = 0.0) -> DiskMargin:
    r"""Return the disk margin of an open loop L, closed by negative feedback.

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        The open loop, with as many outputs as inputs, whose closed loop is stable.
    skew : float, optional
        :math:`\sigma`: 0 for the balanced disk ``(S - T)/2``, 1 for S, -1 for T.

    Returns
    -------
    DiskMargin
        ``.margin``, ``.gain_range``, ``.phase_margin``, ``.phase_margin_deg``, ``.omega``.

    Raises
    ------
    UnstableSystemError
        The closed loop is not proven stable.
    InputError
        Numbers of inputs and outputs differ.

    Notes
    -----
    The norm is that of `hinf_norm`, proven to 1e-8. With several channels the factors may differ and even couple them
    (the norm is the largest singular value), so that the margin for factors of each channel alone can be larger.
    """
    loop = DelaySystem.of(sys, "sys")
    sigma = validation.number("skew", skew)
    if loop.ninputs != loop.noutputs:
        raise InputError(
            f"sys has {loop.ninputs} inputs and {loop.noutputs} outputs: a loop needs as many of both"
        )
    one = np.eye(loop.ninputs)
    S = arithmetic.closed_around(DelaySystem.of(one), loop, -1.0)
    norm, omega = hinf_norm(arithmetic.add(S, DelaySystem.of(0.5 * (sigma - 1.0) * one)))
    alpha = 1.0 / norm if norm > 0.0 else np.inf
    return DiskMargin(alpha, _gain_range(alpha, sigma), _phase_margin(alpha, sigma), omega)


def _gain_range(alpha: float, skew: float) -> tuple[float, float]:
    """Return where the disk meets the positive real axis."""
    if alpha == np.inf:
        return 0.0, np.inf
    up, down = 0.5 * alpha * (1.0 - skew), 0.5 * alpha * (1.0 + skew)
    low = (1.0 - up) / (1.0 + down) if down > -1.0 else 0.0
    return max(low, 0.0), (1.0 + up) / (1.0 - down) if down < 1.0 else np.inf


def _phase_margin(alpha: float, skew: float) -> float:
    r"""Return the angle up to which ``e^{j phi}`` stays in the disk, infinite if all of the unit circle does.

    The disk is :math:`|f - 1| < \alpha\,|(1 - \sigma)/2 + (1 + \sigma)f/2|`, on the unit circle
    :math:`(4/\alpha^2 + 1 - \sigma^2) \sin^2(\varphi/2) < 1`.
    """
    if alpha == 0.0:
        return 0.0
    weight = (2.0 / alpha) ** 2 + 1.0 - skew**2
    return 2.0 * float(np.arcsin(np.sqrt(1.0 / weight))) if weight > 1.0 else np.inf
