r"""Steady response to sums of sines, in closed form.

With the input :math:`u(t) = \sum_k \mathrm{Im}\, U_k e^{j\omega_k t}` for all t, the response of a stable system
is :math:`y(t) = \sum_k \mathrm{Im}\, H(j\omega_k) U_k e^{j\omega_k t}`, delays exact: no integration, no transient.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.integrators import Inputs, as_inputs
from susp_ctrl.delay_systems.model import DelaySystem, loop_response
from susp_ctrl.delay_systems.simulation.simulation_response import names_of
from susp_ctrl.delay_systems.verdict import stability
from susp_ctrl.errors import InputError, UnstableSystemError

# Times between which phasors are turned by one product where the grid is uniform.
_TURN = 128
_MOST_PHASORS = 2_000_000  # phasors formed at once: bounds the memory


class Phasors(NamedTuple):
    """Amplitudes of outputs, states, delayed signals z and inputs, each (signals, lines): ``Im P e^{j omega t}``."""

    omegas: FloatArray
    outputs: ComplexArray
    states: ComplexArray
    delayed: ComplexArray
    inputs: ComplexArray


def steady_response(sys: Any, timepts: ArrayLike, inputs: Any) -> control.TimeResponseData:
    r"""Return the steady response to inputs that are sums of sines, in closed form.

    .. math:: y(t) = \sum_k \mathrm{Im}\, H(j\omega_k) U_k e^{j\omega_k t}

    Parameters
    ----------
    sys : DelayLTI, control.StateSpace or control.TransferFunction
        Stable system.
    timepts : array_like, shape (n_times,)
        Increasing times (s).
    inputs : dict
        Name -> callable with the attribute ``sines`` = (omegas, amplitudes, phases), that triple itself, or a
        number; the signal is ``sum a sin(omega t + phi)`` for all t. Missing inputs are zero.

    Returns
    -------
    control.TimeResponseData
        Outputs, states and inputs by name.

    Raises
    ------
    InputError
        An input that is no sum of sines.
    UnstableSystemError
        The system is unstable: no motion settles on the response.

    Notes
    -----
    The cost grows with lines times points; on uniform time grids phasors are turned by matrix products.
    """
    system = DelaySystem.of(sys, "sys")
    times = validation.increasing("timepts", timepts)
    signals = as_inputs(_named_lines(inputs), system.input_labels, times)
    lines = phasors(system, signals, "inputs")
    if stability(system).stable is False:
        raise UnstableSystemError("sys is unstable: it has no steady response")
    amplitudes = np.concatenate([lines.outputs, lines.states, lines.inputs])
    p, n = system.noutputs, system.nstates
    values = sum_of_lines(lines.omegas, amplitudes, times)
    return control.TimeResponseData(
        times,
        values[:p],
        values[p : p + n],
        values[p + n :] if system.ninputs else None,
        **names_of(system),
    )


def phasors(system: DelaySystem, signals: Inputs, name: str) -> Phasors:
    """Return the phasors of all signals in steady motion.

    Raises
    ------
    InputError
        An input that is no sum of sines, or a frequency at which the system has a pole.
    """
    for part in signals.parts:
        if part.lines is None:
            raise InputError(
                f"{part.name} is no sum of sines: a steady motion needs the attribute sines ({name})"
            )
    omegas = np.unique(
        np.concatenate([np.zeros(0), *(part.lines[0] for part in signals.parts if part.lines)])
    )
    U = np.zeros((signals.size, omegas.size), dtype=complex)
    for part in signals.parts:
        if part.lines is not None:
            w, amplitude, phase = part.lines
            np.add.at(U[part.rows[0]], np.searchsorted(omegas, w), amplitude * np.exp(1j * phase))
    plant, delays = system.folded
    n = plant.n_states
    into_state, y, z = np.split(plant.matrix, [n, n + plant.n_outputs])
    with_all = np.vstack([into_state, y, np.eye(n, z.shape[1]), z, z])
    everything = plant.rebuilt(with_all, plant.n_outputs + n + plant.n_channels)
    s = 1j * omegas
    H = loop_response(everything, s, np.exp(-s[:, None] * delays))
    response = np.einsum("kpq,qk->pk", H, U)
    if not np.all(np.isfinite(response)):
        bad = omegas[int(np.flatnonzero(~np.isfinite(response).all(axis=0))[0])]
        raise InputError(
            f"{name} has a line at {bad:g} rad/s, where the system has a pole: no steady response exists"
        )
    p = plant.n_outputs
    return Phasors(omegas, response[:p], response[p : p + n], response[p + n :], U)


def sum_of_lines(omegas: FloatArray, amplitudes: ComplexArray, times: FloatArray) -> FloatArray:
    """Return ``Im sum_k amplitudes[:, k] e^{j omega_k t}``, shape (signals, times)."""
    values = np.empty((amplitudes.shape[0], times.size))
    step = (times[-1] - times[0]) / max(times.size - 1, 1)
    uniform = times.size > 4 * _TURN and np.allclose(np.diff(times), step, rtol=0, atol=1e-9 * step)
    length = _TURN if uniform else max(1, _MOST_PHASORS // max(1, omegas.size))
    turn = np.exp(1j * np.outer(omegas, step * np.arange(length))) if uniform else None
    for a in range(0, times.size, length):
        b = min(a + length, times.size)
        if turn is None:
            phase = np.exp(1j * np.outer(omegas, times[a:b]))
            values[:, a:b] = amplitudes.imag @ phase.real + amplitudes.real @ phase.imag
        else:
            here = amplitudes * np.exp(1j * omegas * times[a])
            values[:, a:b] = here.imag @ turn.real[:, : b - a] + here.real @ turn.imag[:, : b - a]
    return values


def _named_lines(inputs: Any) -> Any:
    """Let a triple (omegas, amplitudes, phases) stand for its signal."""
    if not isinstance(inputs, dict):
        raise InputError("inputs is not allowed: a dictionary name -> sum of sines is needed")
    return {
        name: _Lines(value) if isinstance(value, Sequence) and len(value) == 3 else value
        for name, value in inputs.items()
    }


class _Lines:
    """A callable that stands for its lines."""

    def __init__(self, sines: Sequence[Any]) -> None:
        self.sines = sines

    def __call__(self, t: FloatArray) -> FloatArray:
        omegas, amplitudes, phases = (np.atleast_1d(np.asarray(a, dtype=float)) for a in self.sines)
        return np.sum(np.atleast_1d(amplitudes) * np.sin(np.multiply.outer(t, omegas) + phases), axis=-1)
