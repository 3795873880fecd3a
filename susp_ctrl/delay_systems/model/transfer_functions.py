"""Systems of python-control taken in and given out: transfer functions, plants with delayed signals, state space."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.errors import InputError


def state_space_of(system: control.TransferFunction, name: str = "system") -> control.StateSpace:
    """Return a state-space realisation of a continuous-time transfer function or matrix of them.

    Each entry of a matrix is realised by itself (python-control needs Slycot for a joint realisation), so the
    result can have more states than the least possible; its response is the same.

    Parameters
    ----------
    system : control.TransferFunction
        Proper in every entry.
    name : str, optional
        Name of the argument in error messages.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InputError
        Discrete time, or an entry with more zeros than poles.
    """
    if system.dt not in (0, None):
        raise InputError(f"{name} has dt = {system.dt}: only continuous time (dt = 0) is possible")
    A, B = np.zeros((0, 0)), np.zeros((0, system.ninputs))
    C, D = np.zeros((system.noutputs, 0)), np.zeros((system.noutputs, system.ninputs))
    for i in range(system.noutputs):
        for j in range(system.ninputs):
            num, den = (np.trim_zeros(np.atleast_1d(c[i][j]), "f") for c in (system.num, system.den))
            if num.size > den.size:
                raise InputError(
                    f"{name} is improper from input {j} to output {i} (degree {num.size - 1} over "
                    f"{den.size - 1}): a proper transfer function is needed"
                )
            if num.size == 0:
                continue
            entry = control.ss(control.tf(num, den))
            n, total = entry.nstates, A.shape[0]
            A = np.block([[A, np.zeros((total, n))], [np.zeros((n, total)), entry.A]])
            column, row = np.zeros((n, system.ninputs)), np.zeros((system.noutputs, n))
            column[:, [j]], row[[i]] = entry.B, entry.C
            B, C = np.vstack([B, column]), np.hstack([C, row])
            D[i, j] = entry.D[0, 0]
    return control.StateSpace(
        A, B, C, D, inputs=system.input_labels, outputs=system.output_labels, name=system.name
    )


def state_space(
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    D: np.ndarray,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str],
) -> control.StateSpace:
    """Return a `control.StateSpace`; a system without inputs gets one named ``idle`` that acts on nothing.

    python-control cannot hold a system without inputs.
    """
    if not inputs:
        B, D, inputs = np.zeros((A.shape[0], 1)), np.zeros((C.shape[0], 1)), ["idle"]
    return control.StateSpace(A, B, C, D, inputs=list(inputs), outputs=list(outputs), states=list(states))


def split_off_channels(system: control.StateSpace, channels: int) -> Realization:
    """Split an ordinary system into external signals and, last, `channels` delayed ones."""
    if not isinstance(system, control.StateSpace):
        raise InputError(f"plant is a {type(system).__name__}: a control.StateSpace is needed")
    if system.dt not in (0, None):
        raise InputError(f"plant has dt = {system.dt}: only continuous time (dt = 0) is possible")
    p, q = system.noutputs - channels, system.ninputs - channels
    if p < 0 or q < 0:
        raise InputError(
            f"plant has {system.ninputs} inputs and {system.noutputs} outputs: "
            f"at least {channels} of each, for the delayed signals, are needed"
        )
    matrix = np.block([[system.A, system.B], [system.C, system.D]])
    return Realization.from_matrix(matrix, system.nstates, p, q)
