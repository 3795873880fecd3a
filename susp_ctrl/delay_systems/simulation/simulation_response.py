"""What a simulation returns: python-control's time response, with its error and its memory."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.integrators import Run
from susp_ctrl.delay_systems.integrators.kinks import propagated_kinks
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.errors import InputError

_FAINT = 1e-3  # weight of an echo that is left out
_APART = 1e-12  # of the run, between two kinks


class SimulationResponse(control.TimeResponseData):
    """A `control.TimeResponseData` that knows its error and can be continued.

    Attributes
    ----------
    error_estimate : ndarray, shape (n_outputs,)
        Estimated largest error of each output, absolute; for the approximate methods that of simulating the
        approximation, which does not know how far it is from the exact delays.
    method : str
        Method that made it.
    order : int or sequence of int or None
        Order of the approximation, for the approximate methods.
    past : object
        Memory of the delayed signals; pass the response as `history` to go on from its end.
    """

    error_estimate: FloatArray
    method: str
    order: Any
    past: Any
    _origin: Origin

    def at(self, timepts: ArrayLike) -> SimulationResponse:
        """Return the response at other times of the same run, not interpolated but computed again.

        Parameters
        ----------
        timepts : array_like, shape (n_times,)
            Increasing times (s) between the start of the run and its end.

        Raises
        ------
        InputError
            A time lies outside the run.
        """
        origin, end = self._origin, float(self.time[-1])
        times = validation.increasing("timepts", timepts, at_least=origin.start)
        if times[-1] > end:
            raise InputError(f"timepts[-1] = {times[-1]:g} is not allowed: the run ends at {end:g} s")
        return simulation_response(origin, origin.march(times), times, self.method, self.order, origin.case)

    def close_kinks(self, gap: float) -> FloatArray:
        """Return the times (s) of announced kinks less than `gap` seconds apart, and of their echoes after delays."""
        sources, end = self._origin.kinks, float(self.time[-1])
        gaps = np.diff(sources)
        close = gaps < gap
        if not np.any(close):
            return np.zeros(0)
        sources = sources[np.append(close, False) | np.append(False, close)]
        plant, delays = self._origin.system.folded
        return propagated_kinks(
            plant, delays, sources, end, 2.0 / float(np.min(gaps)), _FAINT, _APART * max(end, 1.0)
        )


@dataclass(frozen=True)
class Origin:
    """What a response was computed from.

    System, march over any output times, start (s), wanted error, case, and kinks announced by the inputs (s).
    """

    system: DelaySystem
    march: Callable[[FloatArray], Run]
    start: float
    rtol: float
    case: int = 0
    kinks: FloatArray = field(default_factory=lambda: np.zeros(0))


def names_of(system: DelaySystem) -> dict[str, Any]:
    """Return what a `control.TimeResponseData` has to know of its system."""
    return {
        "issiso": system.noutputs == 1 and system.ninputs <= 1,
        "output_labels": system.output_labels,
        "state_labels": system.state_labels,
        "input_labels": system.input_labels if system.ninputs else None,
        "sysname": system.name,
        "plot_inputs": False,
    }


def simulation_response(
    origin: Origin, run: Run, times: FloatArray, method: str, order: Any, case: int = 0
) -> SimulationResponse:
    """Return one case of a run under the system's names; warn where its error exceeds what was wanted."""
    system, rtol = origin.system, origin.rtol
    response = SimulationResponse(
        times,
        run.outputs[:, :, case],
        run.states[:, :, case],
        run.inputs[:, :, case] if system.ninputs else None,
        **names_of(system),
    )
    response.error_estimate = run.error[:, case]
    response.method, response.order, response.past = method, order, run.past.case(case)
    response._origin = replace(origin, case=case)
    relative = run.relative_error[:, case]
    if np.any(relative > rtol):
        worst = int(np.argmax(relative))
        warnings.warn(
            f"the estimated error {run.error[worst, case]:.2g} of {system.output_labels[worst]} exceeds "
            f"rtol = {rtol:g} of its peak {run.peak[worst, case]:.2g}: "
            "an input may have kinks that are not announced (breakpoints)",
            RuntimeWarning,
            stacklevel=3,
        )
    return response
