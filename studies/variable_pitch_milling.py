"""A plant that is no vehicle: chatter of a milling cutter with unevenly spaced teeth.

Two teeth follow one another after the times tau1 and tau2 (one revolution is tau1 + tau2). Each cuts the surface that
the other left, so the force depends on the tool's present and delayed displacement; averaged over the teeth,

    x'' + 2 zeta w x' + w^2 x = -(k w^2/2) ((x(t) - x(t - tau1)) + (x(t) - x(t - tau2)))

with the dimensionless chip width k. With evenly spaced teeth (tau1 = tau2) no speed is worse than
k = 2 zeta (1 + zeta), a closed form that this study prints beside the computed limit. Uneven spacing moves the two
delays apart.

Run it with ``python studies/variable_pitch_milling.py``.
"""

from __future__ import annotations

import math

import pandas as pd

import susp_ctrl as sc

FREQUENCY, DAMPING = 2 * math.pi * 600.0, 0.03  # rad/s; ratio


def cutter(width: float, tau1: float, tau2: float) -> sc.DelayLTI:
    """Return the tool with cutting force: the displacement caused by a disturbing force."""
    w2 = FREQUENCY**2
    now = [[0.0, 1.0], [-w2 * (1.0 + width), -2 * DAMPING * FREQUENCY]]
    tooth = [[0.0, 0.0], [w2 * width / 2, 0.0]]
    return sc.DelayLTI.from_state_delays(
        A=[now, tooth, tooth], delays=[tau1, tau2], B=[[0.0], [w2]], C=[[1.0, 0.0]]
    )


def limit(tau: float, spacing: float, widths: tuple[float, float] = (0.0, 2.0), steps: int = 20) -> float:
    """Return the chip width at which stability is lost at a mean tooth period tau, by bisection.

    `spacing` is tau1/tau2. A wider chip is taken never to be the more stable one.
    """
    low, high = widths
    tau2 = 2 * tau / (1 + spacing)
    for _ in range(steps):
        middle = (low + high) / 2
        if sc.stability(cutter(middle, spacing * tau2, tau2)).stable is True:
            low = middle
        else:
            high = middle
    return low


def study(
    periods: tuple[float, ...] = (2.2, 2.4, 2.6, 2.8, 3.0), spacings: tuple[float, ...] = (1.0, 0.8, 0.6)
):
    """Return the limit of stability over mean tooth periods (in periods of the tool's vibration) and spacings."""
    vibration = 2 * math.pi / FREQUENCY
    rows = {f"spacing {s:g}": [limit(p * vibration, s, steps=12) for p in periods] for s in spacings}
    return pd.DataFrame(rows, index=pd.Index(periods, name="tooth period"))


def main() -> None:
    """Print the limits, the closed form, and what one cut does over all tooth periods."""
    print("chip width at which chatter begins:")
    print(study().round(4).to_string())
    print(
        f"no period is worse than 2 zeta (1 + zeta) = {2 * DAMPING * (1 + DAMPING):.4f} with even spacing\n"
    )
    print("one cut, k = 0.1, even spacing, tooth period from 0 to 2 ms:")
    print(sc.sweep_delays(cutter(0.1, 1e-3, 1e-3), direction=(1, 1), up_to=2e-3))


if __name__ == "__main__":
    main()
