"""`DelayLTI`, the class that users hold: a system with exact delays that speaks python-control's dialect.

python-control's own functions take a `DelayLTI` where they only evaluate it (`frequency_response`,
`nyquist_response`, `singular_values_response`, `frd`). Where they look for matrices or polynomials they fail; the
methods here hand them sampled data instead. A conversion that would lose a delay is refused.
"""

from __future__ import annotations

from typing import Any, Self

import control
import numpy as np
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.approximation import Orders, pade_approximation, spectral_approximation
from susp_ctrl.delay_systems.frequency import (
    default_frequencies,
    disk_margin,
    stability_margins,
    transmission_zeros,
)
from susp_ctrl.delay_systems.model import DelaySystem, arithmetic
from susp_ctrl.delay_systems.roots import characteristic_roots
from susp_ctrl.delay_systems.simulation import impulse_response, simulate, step_response
from susp_ctrl.errors import InputError


class DelayLTI(DelaySystem):
    r"""Linear time-invariant system with exact delays, closed around an ordinary plant.

    .. math:: H(s) = P_{11} + P_{12} E (I - P_{22} E)^{-1} P_{21},\quad E = \mathrm{diag}(g_k e^{-s\tau_k} I)

    Parameters
    ----------
    plant : control.StateSpace or Realization
        ``P`` with inputs ``[u; w]`` and outputs ``[y; z]``: the delayed signals come last in both.
    delays : array_like, shape (n_delays,)
        Delays in seconds, not negative.
    gains : array_like, shape (n_delays,), optional
        Gain of each delayed block; one by default.
    widths : sequence of int, optional
        Number of signals that share each delay; one each by default.
    inputs, outputs, states : sequence of str, optional
        Signal names; taken from `plant` where it has them.
    name : str, optional
        System name.

    Raises
    ------
    InputError
        Wrong shapes, a negative or infinite delay, discrete time, an algebraic loop that has no solution.
    NeutralLoopError
        A delayed signal feeds through directly around the loop.

    Notes
    -----
    Immutable; `with_delays` and `with_gains` give changed copies.
    """

    def pade(self, order: Orders, omega_max: float | None = None) -> control.StateSpace:
        """Return the Padé approximation as a `control.StateSpace`; see `pade_approximation`.

        Parameters
        ----------
        order : int or sequence of int
            Order for all delays, or one for each; 1 to 60.
        omega_max : float, optional
            Highest frequency (rad/s) that matters; a `PadeOrderWarning` tells where the order is too low.

        Returns
        -------
        control.StateSpace
        """
        return pade_approximation(self, order, omega_max)

    def spectral(self, order: Orders) -> control.StateSpace:
        """Return the spectral approximation as a `control.StateSpace`; see `spectral_approximation`.

        Parameters
        ----------
        order : int or sequence of int
            Points of the transport line of all delays, or of each; 1 to 400.

        Returns
        -------
        control.StateSpace
        """
        return spectral_approximation(self, order)

    def feedback(self, other: Any = 1, sign: float = -1, **names: Any) -> Self:
        """Close a loop around this system; see `susp_ctrl.feedback`.

        Parameters
        ----------
        other : DelayLTI, control system, number or matrix, optional
            Return path.
        sign : float, optional
            -1 for negative feedback, 1 for positive.
        **names
            ``inputs``, ``outputs``, ``states``, ``name`` of the result.

        Returns
        -------
        DelayLTI

        Raises
        ------
        InputError
            Numbers of signals that do not fit, another sign, or a delay-free algebraic loop with unit gain.
        """
        weight = validation.number("sign", sign)
        if abs(weight) != 1.0:
            raise InputError(
                f"sign = {weight:g} is not allowed: -1 (negative feedback) or 1 (positive) is needed"
            )
        return arithmetic.closed_around(self, self.of(other, "sys2"), weight).renamed(names)

    def append(self, other: Any) -> Self:
        """Return this system with another one beside it; see `susp_ctrl.append`."""
        return arithmetic.beside(self, self.of(other, "other"))

    # ------------------------------------------------------------------------------------------- conversions

    def to_ss(self, *args: Any, **kwargs: Any) -> control.StateSpace:
        """Return the system as a `control.StateSpace` if no delay is at work in it.

        Parameters
        ----------
        *args, **kwargs
            Accepted for python-control's sake.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        InputError
            A delay is at work: `pade` is the explicit approximation.
        """
        self._refuse_to_lose_delays()
        return pade_approximation(self, 1)

    def to_tf(self, *args: Any, **kwargs: Any) -> control.TransferFunction:
        """Return the system as a `control.TransferFunction` if no delay is at work in it.

        Parameters
        ----------
        *args, **kwargs
            Passed to `control.tf`.

        Returns
        -------
        control.TransferFunction

        Raises
        ------
        InputError
            A delay is at work: `pade` is the explicit approximation.
        """
        return control.tf(self.to_ss(), *args, **kwargs)

    def _refuse_to_lose_delays(self) -> None:
        delays = self.folded.delays
        if delays.size:
            raise InputError(
                f"the system has a delay of {delays.max():g} s, which no state space or transfer function can "
                "express: pade(order) is the explicit approximation"
            )

    # --------------------------------------------------------------------------------------- poles and zeros

    def poles(self, count: int | None = None) -> np.ndarray:
        """Return the rightmost poles: a system with delays has infinitely many.

        Parameters
        ----------
        count : int, optional
            Number of poles; by default at least 8, at least the number of states, and all unstable ones.

        Returns
        -------
        ndarray of complex
            Characteristic roots (rad/s) by descending real part; see `characteristic_roots`.
        """
        if count is not None:
            return characteristic_roots(self, count)
        number = max(8, self.nstates)
        while True:
            found = characteristic_roots(self, number)
            if found.size < number or found[-1].real < 0.0:
                return found
            number *= 2

    def zeros(self, count: int = 8) -> np.ndarray:
        """Return the rightmost transmission zeros of a square system, found on the exact response.

        Parameters
        ----------
        count : int, optional
            Number of zeros; fewer if the system has no more or none can be confirmed.

        Returns
        -------
        ndarray of complex
            Zeros (rad/s) of ``det H(s)`` by descending real part.

        Raises
        ------
        InputError
            Numbers of inputs and outputs differ.
        """
        return transmission_zeros(self, count)

    # ------------------------------------------------------------------------------------ frequency response

    def frequency_response(
        self, omega: ArrayLike | None = None, squeeze: bool | None = None
    ) -> control.FrequencyResponseData:
        """Return the exact response at real frequencies as data with names and plots.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies (rad/s); by default chosen to show every feature, densely where the response moves fast.
        squeeze : bool, optional
            As in python-control.

        Returns
        -------
        control.FrequencyResponseData
        """
        points = self._frequencies(omega)
        return super().frequency_response(points, squeeze=squeeze)

    def bode_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw magnitude and phase.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies (rad/s); by default as in `frequency_response`.
        **kwargs
            `ax` and the other options of `control.bode_plot`.

        Returns
        -------
        control.ControlPlot
        """
        response = self.frequency_response(omega)
        frame = kwargs.get("title_frame", control.config.defaults["freqplot.title_frame"])
        # python-control would centre the title by a layout in which every label asks all panels for their ticks
        options = {**kwargs, "title_frame": "figure"} if frame == "axes" else kwargs
        drawn = control.bode_plot(response, **_own_figure(options))
        if kwargs.get("ax") is None and isinstance(drawn, control.ControlPlot):
            from susp_ctrl.plotting import lay_out  # loads matplotlib

            lay_out(drawn.figure, drawn.axes, centred=frame == "axes")
        return drawn

    def nyquist_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw the Nyquist curve of a system with one input and output.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies (rad/s); by default as in `frequency_response`.
        **kwargs
            `ax` and the other options of `control.nyquist_plot`.

        Returns
        -------
        control.ControlPlot
        """
        points = self._frequencies(omega)
        if omega is None and np.all(np.isfinite(self(0.0, squeeze=False))):
            points = np.union1d([0.0], points)
        # encirclements are not asked for: `margins` and `stability` answer what they stand for
        response = control.nyquist_response(self, points, warn_encirclements=False)
        return response.plot(**_own_figure(kwargs))

    def nichols_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw gain over phase.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies (rad/s); by default as in `frequency_response`.
        **kwargs
            `ax` and the other options of `control.nichols_plot`.

        Returns
        -------
        control.ControlPlot
        """
        return control.nichols_plot(self.frequency_response(omega), **_own_figure(kwargs))

    def singular_values_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw the singular values over frequency.

        Parameters
        ----------
        omega : array_like, optional
            Frequencies (rad/s); by default as in `frequency_response`.
        **kwargs
            `ax` and the other options of `control.singular_values_plot`.

        Returns
        -------
        control.ControlPlot
        """
        response = control.singular_values_response(self, self._frequencies(omega))
        return response.plot(**_own_figure(kwargs))

    # the functions themselves, with the system as the open loop
    margins = stability_margins
    disk_margin = disk_margin

    # ----------------------------------------------------------------------------------------- time response

    def step_response(self, timepts: ArrayLike | None = None) -> control.TimeResponseData:
        """Return the exact step response of every pair of signals.

        Parameters
        ----------
        timepts : array_like, optional
            Times (s), increasing from zero or later, or their end; by default chosen for the slowest root.

        Returns
        -------
        control.TimeResponseData
        """
        return step_response(self, timepts)

    def impulse_response(self, timepts: ArrayLike | None = None) -> control.TimeResponseData:
        """Return the exact impulse response of every pair of signals, without impulses that pass directly.

        Parameters
        ----------
        timepts : array_like, optional
            Times (s), increasing from zero or later, or their end; by default chosen for the slowest root.

        Returns
        -------
        control.TimeResponseData
        """
        return impulse_response(self, timepts)

    def forced_response(
        self, timepts: ArrayLike, inputs: Any = None, **kwargs: Any
    ) -> control.TimeResponseData:
        """Return the exact response to given inputs; see `simulate`.

        Parameters
        ----------
        timepts : array_like
            Times (s), increasing from zero or later.
        inputs : dict, array_like or callable, optional
            As `simulate` takes them.
        **kwargs
            Further options of `simulate`.

        Returns
        -------
        control.TimeResponseData
        """
        return simulate(self, timepts, inputs, **kwargs)

    def initial_response(self, timepts: ArrayLike, history: Any, **kwargs: Any) -> control.TimeResponseData:
        """Return the exact free response from a given past; see `simulate`.

        Parameters
        ----------
        timepts : array_like
            Times (s), increasing from zero or later.
        history : array_like or callable
            State before t = 0, as `simulate` takes it.
        **kwargs
            Further options of `simulate`.

        Returns
        -------
        control.TimeResponseData
        """
        return simulate(self, timepts, None, history=history, **kwargs)

    def _frequencies(self, omega: ArrayLike | None) -> np.ndarray:
        return default_frequencies(self) if omega is None else validation.vector("omega", omega)


def _own_figure(options: dict[str, Any]) -> dict[str, Any]:
    """python-control draws into the current figure: without `ax` or `fig` open one for this plot alone."""
    if options.get("ax") is None and options.get("fig") is None:
        from susp_ctrl.plotting import fresh_figure  # loads matplotlib

        fresh_figure()
    return options
