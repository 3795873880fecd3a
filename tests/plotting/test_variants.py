"""Figures of many variants show the numbers they are given."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from susp_ctrl import plotting


def test_sensitivity_bars_bear_share_and_direction():
    ax = Figure().subplots()
    shares = {"mass": 0.75, "speed": 0.2, "class": np.nan}
    drawn = plotting.draw_sensitivity(shares, {"mass": -0.9, "speed": 0.4, "class": np.nan}, ax)
    assert drawn is ax
    assert [patch.get_width() for patch in ax.patches] == [0.75, 0.2, 0.0]
    assert [patch.get_hatch() for patch in ax.patches] == ["////", "", ""]
    assert [text.get_text() for text in ax.texts] == ["75 %", "20 %", "–"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["mass", "speed", "class"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first one on top


def test_a_distribution_reaches_the_share_of_variants_that_have_a_value():
    ax = Figure().subplots()
    plotting.draw_distribution(
        {"one": [3.0, 1.0, np.nan, 2.0]}, ax, nominal={"one": 1.5}, limit=2.5, xlabel="J"
    )
    curve = ax.lines[0]
    assert curve.get_xdata().tolist() == [1.0, 2.0, 3.0]
    assert curve.get_ydata().tolist() == [0.25, 0.5, 0.75]
    assert any(np.allclose(line.get_xdata(), 2.5) for line in ax.lines)
    assert ax.get_xlabel() == "J"


@pytest.mark.parametrize("size", [3, 12])
def test_a_heat_map_shows_every_number_and_writes_small_ones_out(size):
    ax = Figure().subplots()
    values = np.arange(float(size * size)).reshape(size, size)
    values[0, 1] = np.nan
    names = [str(n) for n in range(size)]
    plotting.draw_heat_map(values, names, names, ax, xlabel="x", ylabel="y", label="J")
    shown = ax.images[0].get_array()
    assert np.array_equal(shown.filled(np.nan), values, equal_nan=True)
    assert ax.images[0].origin == "lower"
    assert len(ax.texts) == (size * size - 1 if size == 3 else 0)
