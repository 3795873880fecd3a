r"""`DelaySystem`: the data of a linear system with any number of exact delays, its value at any point, arithmetic.

Every algorithm takes it; `susp_ctrl.DelayLTI` adds the dialect of python-control on top of them. It is kept in the
linear fractional form of `susp_ctrl.delay_systems.model.lft`, with the delays as given: their number and order, zero
and equal ones too. Algorithms work on `DelaySystem.folded`. What was given as transfer functions or state delays is
kept beside it as it was `written`.

With a direct path from a delayed signal around the loop to itself a system is *neutral*: an infinitely small delay can
create infinitely many unstable roots [1]_. It is refused when it is built: every system here is retarded.

References
----------
.. [1] W. Michiels, S.-I. Niculescu, "Stability, Control, and Computation for Time-Delay Systems", SIAM, 2014,
   chapter 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from numbers import Real
from typing import Any, Self

import control
import numpy as np
from control.lti import LTI
from numpy.typing import ArrayLike

from susp_ctrl import validation
from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.model import arithmetic
from susp_ctrl.delay_systems.model.folding import FoldedLoop, fold, response_at
from susp_ctrl.delay_systems.model.lft import Realization
from susp_ctrl.delay_systems.model.loop_signals import refuse_neutral
from susp_ctrl.delay_systems.model.realizations import (
    checked_state_delays,
    is_number_like,
    split_off_channels,
    state_delay_realization,
    state_space,
    taken_in,
)
from susp_ctrl.delay_systems.model.signal_names import checked_names, signal_labels, system_name
from susp_ctrl.delay_systems.model.system_matrix import SystemMatrix
from susp_ctrl.errors import InputError


class DelaySystem(LTI):
    """A plant P closed through delayed signals, with names; `DelayLTI` documents its arguments."""

    def __init__(
        self,
        plant: control.StateSpace | Realization,
        delays: ArrayLike = (),
        gains: ArrayLike | None = None,
        widths: Sequence[int] | None = None,
        *,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        states: Sequence[str] | None = None,
        name: str | None = None,
    ) -> None:
        tau = validation.delays("delays", delays)
        g = np.ones(tau.size) if gains is None else validation.vector("gains", gains, size=tau.size)
        blocks = (
            [1] * tau.size
            if widths is None
            else [validation.integer("widths", w, at_least=0) for w in validation.sequence("widths", widths)]
        )
        if len(blocks) != tau.size:
            raise InputError(f"widths has {len(blocks)} entries: one for each of {tau.size} delays is needed")
        channels = sum(blocks)
        if isinstance(plant, Realization):
            realization = plant
        else:
            realization = split_off_channels(plant, channels)
            inputs = plant.input_labels[: realization.n_inputs] if inputs is None else inputs
            outputs = plant.output_labels[: realization.n_outputs] if outputs is None else outputs
            states = plant.state_labels if states is None else states
        if realization.n_channels != channels:
            raise InputError(f"plant has {realization.n_channels} delayed signals: {channels} are needed")
        super().__init__(
            inputs=signal_labels("inputs", inputs, realization.n_inputs),
            outputs=signal_labels("outputs", outputs, realization.n_outputs),
            states=signal_labels("states", states, realization.n_states),
            name=system_name(name),
            dt=0,
        )
        validation.entries("plant", *vars(realization).values())
        validation.entries("gains", g)
        for array in (tau, g):
            array.setflags(write=False)
        self._realization = realization
        self._delays, self._gains, self._widths = tau, g, tuple(blocks)
        self._written: SystemMatrix | None = None
        refuse_neutral(self.folded)

    @classmethod
    def from_state_delays(
        cls,
        A: Sequence[ArrayLike],
        delays: ArrayLike,
        B: ArrayLike | None = None,
        C: ArrayLike | None = None,
        D: ArrayLike | None = None,
        input_terms: Sequence[tuple[ArrayLike, float]] = (),
        **names: Any,
    ) -> Self:
        r"""Return the system ``x' = A0 x + sum A_k x(t-tau_k) + B u + sum B_j u(t-d_j)``, ``y = C x + D u``.

        Parameters
        ----------
        A : sequence of array_like, each (n, n)
            ``[A0, A1, ...]``; ``A[1:]`` pairs with `delays`.
        delays : array_like
            Delays of ``A[1:]`` in seconds.
        B, C, D : array_like, optional
            Undelayed matrices (n, q), (p, n), (p, q). Without `B` and `input_terms` the system has no input;
            without `C` the outputs are the states; without `D` it is zero.
        input_terms : sequence of (array_like (n, q), float)
            Delayed input matrices with their delays, which follow in `delays` of the result.
        **names
            ``inputs``, ``outputs``, ``states``, ``name``.

        Returns
        -------
        DelayLTI
            One delayed block for every delay given, as wide as the rank of its matrix.

        Raises
        ------
        InputError
            Shapes or numbers that do not fit.
        """
        given, tau = checked_state_delays(A, delays, B, C, D, input_terms)
        plant, widths = state_delay_realization(*given)
        return cls(plant, tau, widths=widths, **checked_names(names)).with_written(
            SystemMatrix.of_state_delays(*given)
        )

    @property
    def realization(self) -> Realization:
        """The undelayed plant P as matrices; gains and delays are not in it."""
        return self._realization

    @property
    def delays(self) -> FloatArray:
        """Delays in seconds, as given."""
        return self._delays

    @property
    def gains(self) -> FloatArray:
        """Gains of the delayed blocks, as given."""
        return self._gains

    @property
    def widths(self) -> tuple[int, ...]:
        """Number of signals that share each delay."""
        return self._widths

    @property
    def written(self) -> SystemMatrix | None:
        """The system in the polynomials or delayed matrices that were given; None where `realization` is what was."""
        return self._written

    @property
    def plant(self) -> control.StateSpace:
        """The undelayed plant P as a `control.StateSpace` with inputs ``[u; w]`` and outputs ``[y; z]``."""
        r = self._realization
        channel = [f"delayed[{k}]" for k in range(r.n_channels)]
        return state_space(
            r.A,
            np.hstack([r.B1, r.B2]),
            np.vstack([r.C1, r.C2]),
            np.block([[r.D11, r.D12], [r.D21, r.D22]]),
            inputs=[*self.input_labels, *(f"w_{c}" for c in channel)],
            outputs=[*self.output_labels, *(f"z_{c}" for c in channel)],
            states=self.state_labels,
        )

    @classmethod
    def of(cls, system: Any, name: str = "system") -> Self:
        """Return a system of this class equal to a control system, a number or a matrix.

        Parameters
        ----------
        system : DelaySystem, control.StateSpace, control.TransferFunction, number or matrix
            What is to be taken for a system with delays; one of this class is returned as it is.
        name : str, optional
            Name of the argument in error messages.

        Returns
        -------
        DelayLTI

        Raises
        ------
        InputError
            A discrete-time system, frequency data, or something that is no linear system.
        """
        if isinstance(system, cls):
            return system
        if isinstance(system, DelaySystem):
            return cls(**system._settings).with_written(system.written)
        plant, written, label = taken_in(system, name)
        return cls(plant, name=label).with_written(written)

    @property
    def _settings(self) -> dict[str, Any]:
        return {
            "plant": self._realization,
            **{key: getattr(self, key) for key in ("delays", "gains", "widths", "name")},
            "inputs": self.input_labels,
            "outputs": self.output_labels,
            "states": self.state_labels,
        }

    def _with(self, **changes: Any) -> Self:
        return type(self)(**(self._settings | changes)).with_written(
            None if "plant" in changes else self._written
        )

    def with_written(self, matrix: SystemMatrix | None) -> Self:
        """Return the same system with what it was made from.

        Parameters
        ----------
        matrix : SystemMatrix or None

        Returns
        -------
        DelayLTI
        """
        result = copy(self)
        result._written = matrix
        return result

    def with_parts(self, plant: Realization, matrix: SystemMatrix | None, **names: Any) -> Self:
        """Return a system with the same states and delays around another plant, its signals named anew.

        Parameters
        ----------
        plant : Realization
        matrix : SystemMatrix or None
            The same in what was given, None if that is `plant` itself.
        **names
            ``inputs``, ``outputs``, ``name``; generic ones where they are missing.

        Returns
        -------
        DelayLTI
        """
        labels = {"inputs": None, "outputs": None, "name": None} | names
        return self._with(plant=plant, **labels).with_written(matrix)

    def with_delays(self, delays: ArrayLike) -> Self:
        """Return the same system with other delays (s), one for each of `delays`.

        Raises
        ------
        InputError
            If their number differs, or one is negative or not finite.
        """
        return self._with(delays=validation.delays("delays", delays, size=self._delays.size))

    def with_gains(self, gains: ArrayLike) -> Self:
        """Return the same system with other gains, one for each of `gains`.

        Raises
        ------
        InputError
            If their number differs, or one is not finite.
        """
        return self._with(gains=validation.vector("gains", gains, size=self._gains.size))

    def with_names(self, **names: Any) -> Self:
        """Return the same system with other ``inputs``, ``outputs``, ``states`` or ``name``."""
        return self._with(**checked_names(names))

    def renamed(self, names: Mapping[str, Any]) -> Self:
        """Return the same system under those names of a call that are given."""
        labels = {key: value for key, value in checked_names(names).items() if value is not None}
        return self._with(**labels) if labels else self

    @cached_property
    def channel_delays(self) -> FloatArray:
        """Delay of every delayed signal (blocks spread out), shape (channels,)."""
        return np.repeat(self._delays, self._widths)

    @cached_property
    def channel_gains(self) -> FloatArray:
        """Gain of every delayed signal (blocks spread out), shape (channels,)."""
        return np.repeat(self._gains, self._widths)

    @cached_property
    def folded(self) -> FoldedLoop:
        """The loop with gains absorbed, zero delays closed and idle channels dropped."""
        return fold(self._realization, self.channel_gains, self.channel_delays)

    def exponentials(self, s: ArrayLike) -> ComplexArray:
        """Return ``g_k e^{-s tau_k}`` for every delayed signal, shape (*s.shape, channels)."""
        shift: ComplexArray = np.exp(-np.asarray(s, dtype=complex)[..., None] * self.channel_delays)
        return self.channel_gains * shift

    def __call__(self, x: ArrayLike, squeeze: bool | None = None, warn_infinite: bool = True) -> Any:
        """Evaluate the transfer matrix at complex points, delays exact.

        Parameters
        ----------
        x : complex or array_like of complex, shape (n_points,)
            Points s of the complex plane.
        squeeze : bool, optional
            As in python-control: by default a SISO system gives the shape of `x`, others
            (outputs, inputs, n_points).
        warn_infinite : bool, optional
            Accepted for python-control's sake.

        Returns
        -------
        complex or ndarray of complex
        """
        points = np.atleast_1d(validation.complex_array("x", x))
        if points.ndim > 1:
            raise InputError(f"x has shape {points.shape}: a point or a sequence of points is needed")
        values = np.moveaxis(response_at(self.folded, points), 0, -1)
        if np.ndim(x) == 0:
            values = values[..., 0]
        setting = (
            control.config.defaults["control.squeeze_frequency_response"] if squeeze is None else squeeze
        )
        if setting is True:
            return np.squeeze(values)
        if setting is None and self.issiso():
            return values[0, 0]
        return values

    def dcgain(self, warn_infinite: bool = False) -> Any:
        """Return the gain at s = 0, which no delay changes."""
        return self._dcgain(warn_infinite)

    # Arrays and numpy numbers on the left leave the operation to this class instead of taking it apart.
    __array_ufunc__ = None

    def __neg__(self) -> Self:
        return arithmetic.negated(self)

    def __pos__(self) -> Self:
        return self

    def __add__(self, other: Any) -> Self:
        return self._operate(arithmetic.add, other)

    def __radd__(self, other: Any) -> Self:
        return self._operate(arithmetic.add, other, other_first=True)

    def __sub__(self, other: Any) -> Self:
        return self._operate(arithmetic.subtract, other)

    def __rsub__(self, other: Any) -> Self:
        return self._operate(arithmetic.subtract, other, other_first=True)

    def __mul__(self, other: Any) -> Self:
        return self._operate(arithmetic.multiply, other)

    def __rmul__(self, other: Any) -> Self:
        return self._operate(arithmetic.multiply, other, other_first=True)

    def __truediv__(self, other: Any) -> Self:
        if not isinstance(other, (Real, np.number)) or isinstance(other, bool):
            return NotImplemented
        if other == 0:
            raise InputError("division of a system by zero is not allowed")
        return self * (1.0 / validation.number("divisor", other))

    def __getitem__(self, key: Any) -> Self:
        return arithmetic.selected(self, key)

    def _operate(
        self, operation: Callable[[Self, Self], Self], other: Any, other_first: bool = False
    ) -> Self:
        known = (DelaySystem, control.StateSpace, control.TransferFunction)
        # frequency data know how to take a system; no other system of python-control does
        foreign = isinstance(other, control.InputOutputSystem) and not isinstance(other, control.FRD)
        if not isinstance(other, known) and not foreign and not is_number_like(other):
            return NotImplemented
        converted = self.of(other, "operand")
        return operation(converted, self) if other_first else operation(self, converted)

    def __str__(self) -> str:
        delays = ", ".join(f"{d:g} s" for d in self._delays) or "none"
        return (
            f"<{type(self).__name__}> {self.name}: {self.nstates} states\n"
            f"  inputs:  {', '.join(self.input_labels)}\n"
            f"  outputs: {', '.join(self.output_labels)}\n"
            f"  delays:  {delays}\n"
            f"  gains:   {', '.join(f'{g:g}' for g in self._gains) or 'none'}"
        )

    __repr__ = __str__
