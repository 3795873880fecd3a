"""What a study finds out about Padé approximations: errors, order by order, and their cost."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd


@dataclass(frozen=True)
class PadeCase:
    """Error of Padé approximations of one design against the exact delays.

    Attributes
    ----------
    design : str
        Design key.
    time_case : str
        Key of the `TimeCase` whose road is used for the time and RMS errors.
    table : DataFrame
        Columns ``order, frequency_error`` (largest error of the responses from the road to the outputs of the case
        over the band, relative to their peaks), ``root_error`` (1/s, distance of the rightmost roots),
        ``time_error`` (largest error of body acceleration, or else of the first output, relative to its peak),
        ``rms_error`` (largest relative error of the RMS of an output),
        ``stable`` ("stable" | "unstable": what the approximation claims); ``spectral_frequency_error,
        spectral_root_error, spectral_stable``: the same for the spectral (Chebyshev) approximation of that order.
        With a band of the wheel hop also ``wheel_hop_frequency_error`` (as above, over that band) and
        ``wheel_hop_root_error`` (1/s, distance of `wheel_hop_root` from the nearest root of the approximation).
    band : tuple of (float, float)
        Frequencies of `frequency_error` (rad/s).
    recommended_order : tuple of int
        Order for the band, per channel.
    wheel_hop_band : tuple of (float, float) or None
        Frequencies of the wheel hop (rad/s).
    wheel_hop_root : complex or None
        The rightmost exact root in that band (rad/s); None without a band or a root in it.
    indicators : DataFrame or None
        Column ``order``, and for each output of the case the relative error of its RMS.
    met : DataFrame or None
        Columns ``error`` (a column of `table` or of `indicators`), ``tolerance`` (relative), ``order``: the lowest of
        the orders from which on every one keeps the tolerance, nan if none does. Errors of roots count relative to
        the size of the root.
    cost : DataFrame or None
        Measured, so different in every run: ``order`` (0: exact delays), ``states`` of the system that is worked with,
        ``simulation_s, roots_s, frequency_s`` and, as multiples of the exact ones, ``simulation_ratio, roots_ratio,
        frequency_ratio``.
    """

    design: str
    time_case: str
    table: pd.DataFrame
    band: tuple[float, float]
    recommended_order: tuple[int, ...]
    wheel_hop_band: tuple[float, float] | None = None
    wheel_hop_root: complex | None = None
    indicators: pd.DataFrame | None = None
    met: pd.DataFrame | None = None
    cost: pd.DataFrame | None = None
