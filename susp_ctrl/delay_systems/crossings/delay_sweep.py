"""What a delay sweep returns: crossings, intervals, margin, and how far all of it is proven."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import pandas as pd
import scipy.optimize

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems.crossings.delay_line import DelayLine
from susp_ctrl.delay_systems.crossings.small_gain import small_gain_bands
from susp_ctrl.delay_systems.model import around_resonances

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class DelaySweep:
    """Crossings of the imaginary axis along ``delays(tau) = start + tau direction``, ``0 <= tau <= up_to``.

    Attributes
    ----------
    crossings : pandas.DataFrame
        ``tau`` (s), ``omega`` (rad/s), ``tendency`` (+1 to the right, -1 to the left, 0 touch), and the number
        of unstable roots before and after. A row with ``omega > 0`` stands for a conjugate pair; a k-fold
        crossing has k rows.
    intervals : pandas.DataFrame
        ``tau_from``, ``tau_to`` and ``unstable_roots`` between crossings; -1 where the number is not known.
    stable_intervals : list of (float, float)
        Open intervals in which all roots lie left of the axis.
    delay_margin : float
        First loss of stability, a touch included: 0 if the loop is not stable at the start, inf only if it is
        proven stable for every tau, nan if there is no loss up to `up_to` and none is excluded beyond it, or if
        the sweep is not decided.
    decided : bool
        Whether the tendencies agree with the independent counts of unstable roots.
    proven : bool
        Whether the search itself proves that no crossing is missing (else only the counts speak for it).
    axis_roots : tuple of float
        Frequencies of roots that lie on the imaginary axis for every tau (0 for a root at s = 0); with any the
        loop is nowhere stable.
    method : str
        How the crossings were found.
    message : str
        What was checked, or what does not agree.
    """

    direction: FloatArray
    start: FloatArray
    up_to: float
    crossings: pd.DataFrame
    intervals: pd.DataFrame
    delay_margin: float
    decided: bool
    proven: bool
    axis_roots: tuple[float, ...]
    method: str
    message: str
    line: DelayLine

    @property
    def stable_intervals(self) -> list[tuple[float, float]]:
        """Intervals of tau in which the loop is stable."""
        if self.axis_roots or not self.decided:
            return []
        rows = self.intervals[self.intervals["unstable_roots"] == 0]
        return [(float(a), float(b)) for a, b in zip(rows["tau_from"], rows["tau_to"], strict=True)]

    def __bool__(self) -> NoReturn:
        """Refuse: a sweep is no yes or no."""
        raise ValueError("a delay sweep has no truth value: ask for .stable_intervals or .delay_margin")

    def unstable_roots(self, tau: Any) -> np.ndarray:
        """Return the number of unstable roots at tau (any shape); at a crossing that of the interval before."""
        values = np.asarray(tau, dtype=float)
        position = np.searchsorted(self.intervals["tau_to"].to_numpy(), values, side="left")
        return self.intervals["unstable_roots"].to_numpy()[np.minimum(position, len(self.intervals) - 1)]

    @cached_property
    def figure_data(self) -> pd.DataFrame:
        """Curves over ``omega`` (rad/s) that show where a root can be on the axis.

        Where one delay varies, or all that vary are equal: ``z1, z2, ...``, the moduli of the roots z of the
        characteristic equation at s = jw; a root pair crosses where one is 1. Else ``rho``: the largest
        spectral radius of ``P22(jw) E`` over the line; no crossing where it is below 1.
        """
        return _figure_data(self.line, self.crossings["omega"].to_numpy(dtype=float))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw `figure_data` with the unit line and the crossings; return the axes."""
        from susp_ctrl.plotting import draw_unit_modulus  # loads matplotlib

        data = self.figure_data
        curves = {name: data[name].to_numpy() for name in data.columns if name != "omega"}
        in_z = "rho" not in curves
        found = np.unique(self.crossings["omega"].to_numpy(dtype=float)) if in_z else ()
        label = "|z|" if in_z else "largest spectral radius of P22 E"
        return draw_unit_modulus(data["omega"].to_numpy(), curves, ax, crossings=found, ylabel=label)

    def __str__(self) -> str:
        line = ", ".join(
            f"{s:g} + {d:g} tau" if s else f"{d:g} tau"
            for s, d in zip(self.start, self.direction, strict=True)
        )
        parts = [f"Delay sweep: delays ({line}) s, 0 <= tau <= {self.up_to:g} s"]
        if self.crossings.empty:
            parts.append("  no root crosses the imaginary axis")
        else:
            table = self.crossings.to_string(index=False, float_format=lambda v: f"{v:.9g}")
            parts += ["  " + row for row in table.splitlines()]
        for low, high, roots in self.intervals.itertuples(index=False):
            kind = "not decided" if roots < 0 else "stable" if roots == 0 and not self.axis_roots else ""
            kind = kind or (f"{roots} unstable roots" if roots else "a root on the axis")
            parts.append(f"  {low:.9g} < tau < {high:.9g}: {kind}")
        parts += [f"  delay margin {self.delay_margin:.9g} s", f"  {self.method}; {self.message}"]
        return "\n".join(parts)

    __repr__ = __str__


def _figure_data(line: DelayLine, crossings: FloatArray) -> pd.DataFrame:
    loop = line.matrices
    omega = _display_frequencies(line, crossings)
    P = loop.response(omega)
    if line.multiples is not None and line.multiples.max() == 1.0:
        z = _tracked(_moduli_of_common_delay(P, line, omega))
        columns = {f"z{k + 1}": np.abs(z[:, k]) for k in range(z.shape[1])}
    else:
        tau = np.linspace(0.0, line.up_to, 65)
        E = np.exp(-1j * omega[:, None, None] * (line.start + tau[:, None] * line.direction))
        eigenvalues = (
            np.linalg.eigvals(P[:, None] * E[:, :, None, :]) if loop.n_channels else np.zeros((1, 1, 1))
        )
        columns = {"rho": np.abs(eigenvalues).max(axis=(1, 2)) * np.ones_like(omega)}
    return pd.DataFrame({"omega": omega} | columns)


def _moduli_of_common_delay(P: ComplexArray, line: DelayLine, omega: FloatArray) -> ComplexArray:
    """Return all z with ``det(I - P E) = 0`` for the varying channels, the fixed delays being closed."""
    moving = line.direction != 0.0
    start = np.zeros_like(line.start) if line.offset is not None else line.start
    PE = P * np.exp(-1j * omega[:, None] * start)[:, None, :]
    M = PE[:, moving][:, :, moving]
    if not np.all(moving):
        fixed = PE[:, ~moving][:, :, ~moving]
        inner = np.linalg.solve(np.eye(fixed.shape[-1]) - fixed, PE[:, ~moving][:, :, moving])
        M = M + PE[:, moving][:, :, ~moving] @ inner
    with np.errstate(all="ignore"):
        return np.asarray(1.0 / np.linalg.eigvals(np.where(np.isfinite(M), M, 1e300)), dtype=complex)


def _tracked(z: ComplexArray) -> ComplexArray:
    """Order the branches so that each is continuous."""
    result = z.copy()
    if z.shape[1] < 2:
        return result
    for k in range(1, len(z)):
        with np.errstate(all="ignore"):
            cost = np.abs(1.0 / result[k - 1][:, None] - 1.0 / result[k])
        if np.all(np.isfinite(cost)):
            result[k] = result[k][scipy.optimize.linear_sum_assignment(cost)[1]]
    return result


def _display_frequencies(line: DelayLine, crossings: FloatArray) -> FloatArray:
    """Frequencies that show the curves: past the crossings and the band of large gain, dense at resonances."""
    loop = line.matrices
    poles = np.linalg.eigvals(loop.A) if loop.n_states else np.zeros(0)
    bands = small_gain_bands(loop)
    high = max(
        1.3 * float(np.abs(poles).max(initial=0.0)),
        1.3 * float(crossings.max(initial=0.0)),
        1.1 * float((bands.centre + bands.half).max(initial=0.0)),
    )
    high = high or 1.0
    even = np.linspace(0.0, high, 801)[1:]
    low = np.geomspace(high * 1e-3, high, 200)
    around = around_resonances(poles, np.linspace(-3.0, 3.0, 61), narrowest=1e-6 * high)
    omega = np.unique(np.concatenate([even, low, around, crossings]))
    return omega[(omega > 0.0) & (omega <= high)]
