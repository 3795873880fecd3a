"""What python-control's users expect of a system, for `DelayLTI`: methods that keep the delays exact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import control

from susp_ctrl.delay_systems.pade import pade_approximation

if TYPE_CHECKING:
    from susp_ctrl.delay_systems.delay_lti import DelayLTI


class PythonControlMethods:
    """Methods of `DelayLTI` in python-control's dialect."""

    def pade(self, order: int | Sequence[int], omega_max: float | None = None) -> control.StateSpace:
        """Return the Padé approximation as a `control.StateSpace`; see `pade_approximation`.

        Parameters
        ----------
        order : int or sequence of int
            Order for all delays, or one for each; 1 to 60.
        omega_max : float, optional
            Highest frequency (rad/s) that matters; a `PadeOrderWarning` tells where the order is too low.
        """
        return pade_approximation(cast("DelayLTI", self), order, omega_max)
