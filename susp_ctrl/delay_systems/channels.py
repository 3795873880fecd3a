"""Feedback channels: which signal is fed back where, with which gain and which delay.

A channel adds ``gain * measured(t - delay)`` to an input of the plant. `close_loop` closes any number of them,
`open_loop` breaks the loop at the actuators, `loop_plant` gives the undelayed plant that both stand on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems.delay_lti import DelayLTI
from susp_ctrl.delay_systems.model import Realization, SystemMatrix, names_together
from susp_ctrl.errors import InputError


@dataclass(frozen=True)
class FeedbackChannel:
    """One delayed feedback path: ``actuator(t) += gain * measured(t - delay)``.

    Parameters
    ----------
    measured : str or int
        Output of the plant that is fed back.
    actuator : str or int
        Input of the plant that the channel acts on.
    gain : float
        Gain, in units of the actuator per unit of the measured signal (N/m for displacement to force).
    delay : float
        Delay in seconds, not negative.
    actuator_bandwidth : float, optional
        Bandwidth (rad/s) of a first-order actuator ``1/(1 + s/bandwidth)`` between the channel and the plant.
        Without it the actuator is immediate.

    Raises
    ------
    InputError
        A number that is not finite, a negative delay, a bandwidth that is not positive.
    """

    measured: str | int
    actuator: str | int
    gain: float
    delay: float = 0.0
    actuator_bandwidth: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", validation.number("gain", self.gain))
        object.__setattr__(self, "delay", validation.delay("delay", self.delay))
        if self.actuator_bandwidth is not None:
            bandwidth = validation.number("actuator_bandwidth", self.actuator_bandwidth, above=0.0)
            object.__setattr__(self, "actuator_bandwidth", bandwidth)

    def replace(self, **changes: Any) -> FeedbackChannel:
        """Return a copy with some fields changed."""
        return replace(self, **changes)


def loop_plant(plant: Any, channels: FeedbackChannel | Sequence[FeedbackChannel]) -> Realization:
    """Return the undelayed plant P of a loop: inputs ``[u; w]``, outputs ``[y; z]``, without gains and delays.

    Parameters
    ----------
    plant : control.StateSpace, control.TransferFunction or DelayLTI
        The plant; delayed signals that it already has come first in w and z.
    channels : FeedbackChannel or sequence of FeedbackChannel
        Only their signals and actuator bandwidths are used.

    Returns
    -------
    Realization
    """
    base = DelayLTI.of(plant, "plant")
    r = base.realization
    for channel in _checked(channels):
        y = validation.signal_index("measured", channel.measured, base.output_labels)
        u = validation.signal_index("actuator", channel.actuator, base.input_labels)
        column = r.matrix[:, r.n_states + u]
        if channel.actuator_bandwidth is not None:
            r = _add_lag(r, u, channel.actuator_bandwidth)
            column = np.eye(r.matrix.shape[0])[r.n_states - 1] * channel.actuator_bandwidth
        widened = np.column_stack([r.matrix, column])
        # z is the measured output, w enters as the actuator does
        r = r.rebuilt(np.vstack([widened, widened[r.n_states + y]]))
    return r


def close_loop(
    plant: Any, channels: FeedbackChannel | Sequence[FeedbackChannel], *, name: str | None = None
) -> DelayLTI:
    """Close delayed feedback channels around a plant.

    The result keeps the plant's inputs and outputs; each channel adds ``gain * measured(t - delay)`` to its
    actuator, so inputs given from outside act in addition.

    Parameters
    ----------
    plant : control.StateSpace, control.TransferFunction or DelayLTI
        Continuous-time plant with named signals.
    channels : FeedbackChannel or sequence of FeedbackChannel
        One or any number; the same signal may be fed back through several delays.
    name : str, optional
        Name of the closed loop.

    Returns
    -------
    DelayLTI
        Its `delays` and `gains` are those of the channels, in their order (after those of a plant that has
        delays of its own).

    Raises
    ------
    InputError
        An unknown signal (the message names the nearest one), an ill-posed loop.
    NeutralLoopError
        Delayed feed-through around the loop; give the channel an `actuator_bandwidth`.
    """
    base = DelayLTI.of(plant, "plant")
    paths = _checked(channels)
    r = loop_plant(base, paths)
    lags = [f"{_label(c.actuator)}_lag[{k}]" for k, c in enumerate(paths) if c.actuator_bandwidth is not None]
    result = DelayLTI(
        r,
        np.append(base.delays, [c.delay for c in paths]),
        np.append(base.gains, [c.gain for c in paths]),
        (*base.widths, *(1 for _ in paths)),
        inputs=base.input_labels,
        outputs=base.output_labels,
        states=names_together(base.state_labels, lags),
        name=name,
    )
    y, u = _places(base, paths)
    q, p, m = base.ninputs, base.noutputs, len(paths)
    # inputs of the plant: from outside and from the channels; into the channels: the measured outputs
    law = np.block([[np.zeros((q, p)), np.eye(q)[:, u]], [np.eye(p)[y], np.zeros((m, m))]])
    return result.with_written(_written(base, paths, law, np.eye(q + m, q), np.eye(p, p + m)))


def open_loop(
    plant: Any, channels: FeedbackChannel | Sequence[FeedbackChannel], *, name: str | None = None
) -> DelayLTI:
    """Break the loop at the actuators: margins and Nyquist plots of the result read as usual.

    ``L(s)`` maps the forces that act on the plant to minus the forces that the channels return, so that the
    closed loop is ``(I + L)^-1``.

    Parameters
    ----------
    plant : control.StateSpace, control.TransferFunction or DelayLTI
        Continuous-time plant with named signals.
    channels : FeedbackChannel or sequence of FeedbackChannel
        The channels of the loop.
    name : str, optional
        Name of the open loop.

    Returns
    -------
    DelayLTI
        Inputs and outputs are the actuators in use, in the order of their first use.

    Raises
    ------
    InputError
        No channel, or an unknown signal.
    """
    base = DelayLTI.of(plant, "plant")
    paths = _checked(channels)
    if not paths:
        raise InputError("channels is empty: at least one FeedbackChannel is needed")
    r = base.realization
    measured, actuators = _places(base, paths)
    used = list(dict.fromkeys(actuators))
    lags = [k for k, c in enumerate(paths) if c.actuator_bandwidth is not None]
    n, inner, m = r.n_states, r.n_channels, len(paths)
    rates = np.array([paths[k].actuator_bandwidth for k in lags], dtype=float)
    returned = -np.array([[float(a == u) for a in actuators] for u in used])
    through_lag = np.isin(np.arange(m), lags)
    realization = Realization(
        A=np.block([[r.A, np.zeros((n, len(lags)))], [np.zeros((len(lags), n)), -np.diag(rates)]]),
        B1=np.vstack([r.B1[:, used], np.zeros((len(lags), len(used)))]),
        B2=np.block(
            [[r.B2, np.zeros((n, m))], [np.zeros((len(lags), inner)), np.diag(rates) @ np.eye(m)[lags]]]
        ),
        C1=np.hstack([np.zeros((len(used), n)), returned[:, lags]]),
        C2=np.hstack([np.vstack([r.C2, r.C1[measured]]), np.zeros((inner + m, len(lags)))]),
        D11=np.zeros((len(used), len(used))),
        D12=np.hstack([np.zeros((len(used), inner)), returned * ~through_lag]),
        D21=np.vstack([r.D21[:, used], r.D11[np.ix_(measured, used)]]),
        D22=np.block([[r.D22, np.zeros((inner, m))], [r.D12[measured], np.zeros((m, m))]]),
    )
    labels = [base.input_labels[u] for u in used]
    result = DelayLTI(
        realization,
        np.append(base.delays, [c.delay for c in paths]),
        np.append(base.gains, [c.gain for c in paths]),
        (*base.widths, *(1 for _ in paths)),
        inputs=labels,
        outputs=labels,
        states=names_together(base.state_labels, [f"{_label(paths[k].actuator)}_lag[{k}]" for k in lags]),
        name=name,
    )
    q, p = base.ninputs, base.noutputs
    law = np.block([[np.zeros((q, p + m))], [np.eye(p)[measured], np.zeros((m, m))]])
    entry = np.vstack([np.eye(q)[:, used], np.zeros((m, len(used)))])
    exit_ = np.hstack([np.zeros((len(used), p)), returned])
    return result.with_written(_written(base, paths, law, entry, exit_))


def _places(base: DelayLTI, paths: Sequence[FeedbackChannel]) -> tuple[list[int], list[int]]:
    """Return the numbers of the measured outputs and of the inputs that are driven."""
    return (
        [validation.signal_index("measured", c.measured, base.output_labels) for c in paths],
        [validation.signal_index("actuator", c.actuator, base.input_labels) for c in paths],
    )


def _written(
    base: DelayLTI, paths: Sequence[FeedbackChannel], law: FloatArray, entry: FloatArray, exit_: FloatArray
) -> SystemMatrix | None:
    """Return a plant beside its channels, joined, in the polynomials and matrices that the plant was given in."""
    if base.written is None:
        return None
    both = base.written
    for channel in paths:
        both = both.beside(_system_matrix_of(channel))
    return both.joined(law, entry, exit_)


def _system_matrix_of(channel: FeedbackChannel) -> SystemMatrix:
    """Return delay and actuator of a channel: ``(s + b) v = b e^{-s tau} u``, ``y = v``, or the delay alone."""
    b = channel.actuator_bandwidth
    if b is None:
        return SystemMatrix({(0, 0): np.ones((1, 1))}, 0, 1)
    undelayed = np.array([[b, 0.0], [1.0, 0.0]])
    return SystemMatrix({(1, None): np.diag([1.0, 0.0]), (0, None): undelayed, (0, 0): np.diag([b], 1)}, 1, 1)


def _label(signal: str | int) -> str:
    return signal if isinstance(signal, str) else f"input[{signal}]"


def _checked(channels: FeedbackChannel | Sequence[FeedbackChannel]) -> list[FeedbackChannel]:
    paths = (
        [channels]
        if isinstance(channels, FeedbackChannel)
        else list(validation.sequence("channels", channels))
    )
    for k, channel in enumerate(paths):
        if not isinstance(channel, FeedbackChannel):
            raise InputError(f"channels[{k}] is a {type(channel).__name__}: a FeedbackChannel is needed")
    return paths


def _add_lag(r: Realization, u: int, bandwidth: float) -> Realization:
    """Append the state of a first-order actuator that drives input `u`."""
    n = r.n_states
    widened = np.insert(r.matrix, n, r.matrix[:, n + u], axis=1)
    whole = np.insert(widened, n, -bandwidth * np.eye(widened.shape[1])[n], axis=0)
    return Realization.from_matrix(whole, n + 1, r.n_outputs, r.n_inputs)
