"""What is drawn: the data of lines and bars, the units of the axes, and nothing of the user's settings changed."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from susp_ctrl import plotting

OMEGA = np.array([1.0, 2.0, 4.0, 8.0])


@pytest.fixture(autouse=True)
def _closed_figures() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture
def ax() -> plt.Axes:
    return Figure().subplots()


def test_no_setting_of_the_user_is_changed() -> None:
    before = matplotlib.rcParams.copy()
    figure, axes = plotting.new_figure(2, 1)
    plotting.draw_bode(OMEGA, {"a": 1.0 / (1.0 + 1j * OMEGA)}, (axes[0, 0], axes[1, 0]))
    plotting.draw_intervals({"a": [(0.0, 1.0, 0)]}, plotting.new_figure()[1][0, 0])
    plotting.shared_legend(figure, axes)
    assert matplotlib.rcParams.copy() == before


def test_magnitude_is_drawn_over_hertz(ax: plt.Axes) -> None:
    assert plotting.draw_magnitude(OMEGA, {"a": [1.0, 2.0, 3.0, 4.0]}, ax) is ax
    (line,) = ax.get_lines()
    np.testing.assert_allclose(line.get_xdata(), OMEGA / (2 * np.pi), rtol=1e-15)
    np.testing.assert_array_equal(line.get_ydata(), [1.0, 2.0, 3.0, 4.0])
    assert "Hz" in ax.get_xlabel()
    assert ax.get_xscale() == "log"


def test_decibels_are_twenty_logarithms_and_zero_leaves_a_gap(ax: plt.Axes) -> None:
    plotting.draw_magnitude(OMEGA, {"a": [1.0, 10.0, 0.0, 0.1]}, ax, decibel=True)
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), [0.0, 20.0, np.nan, -20.0], atol=1e-12)


def test_phase_is_unwrapped_and_in_degrees() -> None:
    upper, lower = Figure().subplots(2)
    omega = np.linspace(0.1, 50.0, 400)
    plotting.draw_bode(omega, {"delay": np.exp(-0.5j * omega)}, (upper, lower))
    np.testing.assert_allclose(lower.get_lines()[0].get_ydata(), np.degrees(-0.5 * omega), atol=1e-9)
    np.testing.assert_allclose(upper.get_lines()[0].get_ydata(), 0.0, atol=1e-12)


def test_history_scales_and_overlays_the_approximation_as_markers(ax: plt.Axes) -> None:
    time = np.linspace(0.0, 1.0, 101)
    plotting.draw_history(time, {"a": time}, ax, overlay={"a": time + 0.5}, overlay_count=10, scale=1000.0)
    exact, approximate = ax.get_lines()
    np.testing.assert_allclose(exact.get_ydata(), 1000.0 * time)
    assert exact.get_marker() in ("", "None")
    assert approximate.get_linestyle() == "None"
    assert len(approximate.get_xdata()) == 11
    np.testing.assert_allclose(approximate.get_ydata(), 1000.0 * (np.asarray(approximate.get_xdata()) + 0.5))
    assert approximate.get_color() == exact.get_color()


def test_road_is_drawn_in_millimetres(ax: plt.Axes) -> None:
    plotting.draw_road([0.0, 1.0], {"front": [0.0, 0.05], "rear": [0.0, 0.0]}, ax)
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), [0.0, 50.0])
    assert "mm" in ax.get_ylabel()


def test_intervals_tell_stable_unstable_and_undecided_apart_without_colour(ax: plt.Axes) -> None:
    rows = {"one": [(0.0, 0.4, 0), (0.4, 1.0, 2)], "two": [(0.0, 1.0, -1)]}
    plotting.draw_intervals(rows, ax, marks={"one": 0.3}, claims={"two": 0.63})
    bars = [patch for patch in ax.patches if patch.get_width() > 0]
    assert [(bar.get_x(), round(bar.get_width(), 12)) for bar in bars] == [(0.0, 0.4), (0.4, 0.6), (0.0, 1.0)]
    assert len({bar.get_hatch() for bar in bars}) == 3
    assert [text.get_text() for text in ax.texts] == ["2"]
    mark, claim = ax.get_lines()
    assert float(mark.get_xdata()[0]) == 0.3
    assert float(claim.get_xdata()[0]) == 0.63
    assert [label.get_text() for label in ax.get_yticklabels()] == ["one", "two"]


def test_unit_modulus_marks_crossings_on_the_unit_line(ax: plt.Axes) -> None:
    plotting.draw_unit_modulus(OMEGA, {"|z|": [0.5, np.inf, 2.0, 4.0]}, ax, crossings=[3.0])
    curve, unit, crossing = ax.get_lines()
    np.testing.assert_array_equal(curve.get_ydata(), [0.5, np.nan, 2.0, 4.0])
    np.testing.assert_array_equal(unit.get_ydata(), [1.0, 1.0])
    np.testing.assert_allclose(crossing.get_xdata(), [3.0 / (2 * np.pi)])
    np.testing.assert_array_equal(crossing.get_ydata(), [1.0])


def test_order_errors_leave_out_what_a_logarithm_cannot_show(ax: plt.Axes) -> None:
    plotting.draw_order_error([2, 4, 8], {"error": [0.1, 0.0, np.nan]}, ax, needed=5.0)
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), [0.1, np.nan, np.nan])
    assert ax.get_lines()[1].get_xdata()[0] == 5.0


def test_changes_carry_their_sign(ax: plt.Axes) -> None:
    plotting.draw_changes(["a", "b"], {"ours": [-28.2, 11.0]}, ax)
    assert [patch.get_width() for patch in ax.patches] == [-28.2, 11.0]
    assert {"-28", "+11"} <= {text.get_text() for text in ax.texts}


def test_convergence_keeps_a_linear_axis_for_values_that_are_not_positive(ax: plt.Axes) -> None:
    plotting.draw_convergence({"a": [3.0, 1.0, 0.0]}, ax)
    assert ax.get_yscale() == "linear"
    other = plotting.draw_convergence({"a": [3.0, 1.0, 0.1]}, Figure().subplots(), reference=2.0)
    assert other.get_yscale() == "log"


def test_detuning_is_drawn_in_percent(ax: plt.Axes) -> None:
    plotting.draw_detuning([-0.05, 0.0, 0.05], {"a": [1.0, 0.0, 1.0]}, ax)
    np.testing.assert_allclose(ax.get_lines()[0].get_xdata(), [-5.0, 0.0, 5.0])


def test_without_axes_a_new_figure_is_made() -> None:
    first = plotting.draw_magnitude(OMEGA, {"a": OMEGA})
    assert first.figure.number in plt.get_fignums()
    assert plotting.draw_history([0.0, 1.0], {"a": [0.0, 1.0]}).figure is not first.figure


def test_every_two_curves_differ_in_more_than_colour() -> None:
    looks = [plotting.curve_style(number) for number in range(8)]
    assert len({(str(look["linestyle"]), look["marker"]) for look in looks}) == 8
    # Grey levels (ITU-R BT.709) of the three curves of a comparison: passive, published, tuned.
    grey = [np.dot((0.2126, 0.7152, 0.0722), to_rgb(look["color"])) for look in looks[:3]]
    assert max(grey) < 0.6, "dark enough on white paper"


def test_a_role_always_looks_the_same_and_others_keep_clear_of_it() -> None:
    styles = plotting.styles_for(["x", "ours"], {"ours": "tuned"})
    assert styles["ours"] == plotting.curve_style("tuned")
    assert styles["x"] != styles["ours"]
    with pytest.raises(KeyError):
        plotting.curve_style("unknown")


@pytest.mark.parametrize(
    ("limits", "value", "label"),
    [
        ((0.01, 100.0), 0.1, "0.1"),
        ((1e-8, 1.0), 1e-6, "10⁻⁶"),
        ((0.7, 0.95), 0.8, "0.8"),
        ((1.0, 1e6), 2e4, ""),
    ],
)
def test_logarithmic_labels(limits: tuple[float, float], value: float, label: str) -> None:
    ax = Figure().subplots()
    ax.set_yscale("log")
    ax.set_ylim(*limits)
    plotting.powers_of_ten(ax.yaxis)
    assert ax.yaxis.get_major_formatter().format_ticks([value]) == [label]
