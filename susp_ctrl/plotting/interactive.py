"""A fresh figure for plots that others draw: python-control takes the current figure unless told otherwise."""

from __future__ import annotations

from matplotlib.figure import Figure


def fresh_figure() -> Figure:
    """Open an empty pyplot figure and make it current, so that no earlier plot is drawn over."""
    import matplotlib.pyplot as plt

    return plt.figure()
