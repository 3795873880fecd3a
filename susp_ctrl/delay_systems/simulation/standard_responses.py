r"""Step and impulse responses, exact, for all pairs of signals.

The impulse response of H is the step response of ``s H(s)``, which is again a loop with the same delays: its
outputs are the time derivatives of y. Impulses that pass directly to an output are left out, as in
python-control.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.model import DelaySystem
from susp_ctrl.delay_systems.roots import characteristic_roots
from susp_ctrl.delay_systems.simulation.time_response import simulate


def step_response(sys: DelaySystem, timepts: ArrayLike | None = None) -> control.TimeResponseData:
    """Return the response of every output to a unit step of every input.

    Parameters
    ----------
    sys : DelayLTI
        The system.
    timepts : array_like or float, optional
        Times (s), or their end; by default from 0 until the slowest root has decayed.

    Returns
    -------
    control.TimeResponseData
        Outputs of shape (outputs, inputs, times): one trace for each input. Values at a jump are those just
        after it.
    """
    return _traces(sys, sys, timepts, "Step response")


def impulse_response(sys: DelaySystem, timepts: ArrayLike | None = None) -> control.TimeResponseData:
    """Return the response of every output to a unit impulse of every input.

    Parameters
    ----------
    sys : DelayLTI
        The system.
    timepts : array_like or float, optional
        Times (s), or their end; by default from 0 until the slowest root has decayed.

    Returns
    -------
    control.TimeResponseData
        Outputs of shape (outputs, inputs, times); impulses that reach an output directly are left out.
    """
    return _traces(sys, derivative(sys), timepts, "Impulse response")


def derivative(sys: DelaySystem) -> DelaySystem:
    """Return ``s H(s)`` without the impulses, as a system of the same delays.

    Beside the delayed signals w come their derivatives w', with ``z' = C2 x' + D22 w'``, and
    ``y' = C1 x' + D12 w'``, where ``x' = A x + B1 u + B2 w``.
    """
    r = sys.realization
    slope, zero = r.matrix[: r.n_states], np.zeros((r.n_states + r.n_channels, r.n_channels))
    whole = np.block([
        [slope, zero[: r.n_states]],
        [r.C1 @ slope, r.D12],
        [r.matrix[r.n_states + r.n_outputs :], zero[r.n_states :]],
        [r.C2 @ slope, r.D22],
    ])  # fmt: skip
    realization = r.rebuilt(whole)
    labels = {"inputs": sys.input_labels, "outputs": sys.output_labels, "states": sys.state_labels}
    return DelaySystem(realization, np.tile(sys.delays, 2), np.tile(sys.gains, 2), sys.widths * 2, **labels)


def default_times(sys: DelaySystem) -> FloatArray:
    """Return 1000 times that show the slowest rightmost roots and several times the longest delay."""
    roots = characteristic_roots(sys, 8)
    longest = float(np.sum(sys.folded.delays))
    if roots.size == 0:
        return np.linspace(0.0, 3.0 * longest or 1.0, 1000)
    abscissa = float(roots[0].real)
    size = float(np.max(np.abs(roots)))
    if abscissa < -1e-4 * size:
        end = 7.0 / -abscissa
    elif abscissa > 1e-4 * size:
        end = 4.0 / abscissa
    else:
        end = 60.0 / size if size > 0.0 else 10.0
    return np.linspace(0.0, end + 3.0 * longest, 1000)


def _times(sys: DelaySystem, timepts: ArrayLike | None) -> FloatArray:
    if timepts is None:
        return default_times(sys)
    if validation.is_scalar(timepts):
        return np.linspace(0.0, validation.number("timepts", timepts, above=0.0), 1000)
    return validation.increasing("timepts", timepts, at_least=0.0)


def _traces(
    sys: DelaySystem, simulated: DelaySystem, timepts: ArrayLike | None, title: str
) -> control.TimeResponseData:
    times = _times(sys, timepts)
    p, q = sys.noutputs, sys.ninputs
    outputs, inputs = np.zeros((p, q, times.size)), np.zeros((q, q, times.size))
    states: Any = np.zeros((sys.nstates, q, times.size))
    for j, label in enumerate(sys.input_labels):
        response = simulate(simulated, times, {label: 1.0})
        outputs[:, j] = np.asarray(response.y).reshape(p, times.size)
        states[:, j] = np.asarray(response.x).reshape(sys.nstates, times.size)
        inputs[j, j] = 1.0
    step = simulated is sys
    return control.TimeResponseData(
        times,
        outputs,
        states if step else None,
        inputs if step else None,
        issiso=sys.issiso(),
        output_labels=sys.output_labels,
        input_labels=sys.input_labels if step else None,
        state_labels=sys.state_labels if step else None,
        trace_labels=[f"From {label}" for label in sys.input_labels],
        trace_types=["step" if step else "impulse"] * q,
        title=f"{title} for {sys.name}",
        sysname=sys.name,
        plot_inputs=False,
    )
