"""What python-control's users expect of a system, for `DelayLTI`: methods that keep the delays exact.

python-control's own functions take a `DelayLTI` where they only evaluate it (`frequency_response`,
`nyquist_response`, `singular_values_response`, `frd`). Where they look for matrices or polynomials they fail; the
methods here hand them sampled data instead. A conversion that would lose a delay is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import control
import numpy as np
from control.lti import LTI
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.delay_systems.approximation.pade import close_bank, pade_approximation, pade_bank
from susp_ctrl.delay_systems.approximation.spectral import spectral_approximation
from susp_ctrl.errors import InputError

if TYPE_CHECKING:
    from susp_ctrl.delay_systems.frequency.margins import StabilityMargins
    from susp_ctrl.delay_systems.model.system import DelayLTI


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
        return pade_approximation(self._system, order, omega_max)

    def spectral(self, order: int | Sequence[int]) -> control.StateSpace:
        """Return the spectral approximation as a `control.StateSpace`; see `spectral_approximation`.

        Parameters
        ----------
        order : int or sequence of int
            Points of the transport line of all delays, or of each; 1 to 400.
        """
        return spectral_approximation(self._system, order)

    # ------------------------------------------------------------------------------------------- conversions

    def to_ss(self, *args: Any, **kwargs: Any) -> control.StateSpace:
        """Return the system as a `control.StateSpace` if no delay is at work in it.

        Raises
        ------
        InputError
            A delay is at work: `pade` is the explicit approximation.
        """
        self._refuse_to_lose_delays()
        system = self._system
        bank = pade_bank((1,) * system.delays.size, system)
        return close_bank(system, bank, [])

    def to_tf(self, *args: Any, **kwargs: Any) -> control.TransferFunction:
        """Return the system as a `control.TransferFunction` if no delay is at work in it.

        Raises
        ------
        InputError
            A delay is at work: `pade` is the explicit approximation.
        """
        return control.tf(self.to_ss(), *args, **kwargs)

    def _refuse_to_lose_delays(self) -> None:
        delays = self._system.folded.delays
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
        from susp_ctrl.delay_systems.roots.rightmost import characteristic_roots

        if count is not None:
            return characteristic_roots(self._system, count)
        number = max(8, self._system.nstates)
        while True:
            found = characteristic_roots(self._system, number)
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
        from susp_ctrl.delay_systems.frequency.zeros import transmission_zeros

        return transmission_zeros(self._system, count)

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
        """
        points = self._frequencies(omega)
        return LTI.frequency_response(self._system, points, squeeze=squeeze)

    def bode_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw magnitude and phase; `ax` and other options as in `control.bode_plot`."""
        return control.bode_plot(self.frequency_response(omega), **_own_figure(kwargs))

    def nyquist_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw the Nyquist curve of a system with one input and output; options as in `control.nyquist_plot`."""
        points = self._frequencies(omega)
        if omega is None and np.all(np.isfinite(self._system(0.0, squeeze=False))):
            points = np.union1d([0.0], points)
        # encirclements are not asked for: `margins` and `stability` answer what they stand for
        response = control.nyquist_response(self._system, points, warn_encirclements=False)
        return response.plot(**_own_figure(kwargs))

    def nichols_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw gain over phase; options as in `control.nichols_plot`."""
        return control.nichols_plot(self.frequency_response(omega), **_own_figure(kwargs))

    def singular_values_plot(self, omega: ArrayLike | None = None, **kwargs: Any) -> Any:
        """Draw the singular values over frequency; options as in `control.singular_values_plot`."""
        response = control.singular_values_response(self._system, self._frequencies(omega))
        return response.plot(**_own_figure(kwargs))

    def margins(self, omega_range: tuple[float, float] | None = None) -> StabilityMargins:
        """Return gain, phase and delay margins, least over all crossovers; see `stability_margins`."""
        from susp_ctrl.delay_systems.frequency.margins import stability_margins

        return stability_margins(self._system, omega_range)

    # ----------------------------------------------------------------------------------------- time response

    def step_response(self, timepts: ArrayLike | None = None) -> control.TimeResponseData:
        """Return the exact step response of every pair of signals.

        Parameters
        ----------
        timepts : array_like, optional
            Times (s), increasing from zero or later.
        """
        from susp_ctrl.delay_systems.simulation.standard_responses import step_response

        return step_response(self._system, timepts)

    def impulse_response(self, timepts: ArrayLike | None = None) -> control.TimeResponseData:
        """Return the exact impulse response of every pair of signals, without impulses that pass directly.

        Parameters
        ----------
        timepts : array_like, optional
            Times (s), increasing from zero or later.
        """
        from susp_ctrl.delay_systems.simulation.standard_responses import impulse_response

        return impulse_response(self._system, timepts)

    def forced_response(
        self, timepts: ArrayLike, inputs: Any = None, **kwargs: Any
    ) -> control.TimeResponseData:
        """Return the exact response to given inputs; see `simulate`."""
        from susp_ctrl.delay_systems.simulation.time_response import simulate

        return simulate(self._system, timepts, inputs, **kwargs)

    def initial_response(self, timepts: ArrayLike, history: Any, **kwargs: Any) -> control.TimeResponseData:
        """Return the exact free response from a given past; `history` as in `simulate`."""
        from susp_ctrl.delay_systems.simulation.time_response import simulate

        return simulate(self._system, timepts, None, history=history, **kwargs)

    @property
    def _system(self) -> DelayLTI:
        return cast("DelayLTI", self)

    def _frequencies(self, omega: ArrayLike | None) -> np.ndarray:
        from susp_ctrl.delay_systems.frequency.frequency_range import default_frequencies

        return default_frequencies(self._system) if omega is None else validation.vector("omega", omega)


def _own_figure(options: dict[str, Any]) -> dict[str, Any]:
    """python-control draws into the current figure: without `ax` or `fig` open one for this plot alone."""
    if options.get("ax") is None and options.get("fig") is None:
        from susp_ctrl.plotting.interactive import fresh_figure

        fresh_figure()
    return options
