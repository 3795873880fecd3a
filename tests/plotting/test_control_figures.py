"""Bode plots of `DelayLTI`: python-control's content and options in a layout that is made once."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import susp_ctrl as sc


def _loop(outputs: int, inputs: int) -> sc.DelayLTI:
    """A delayed loop around a lag of every output, with all pairs of signals."""
    a = -np.diag(np.geomspace(0.5, 20.0, 4))
    b = 1.0 + np.arange(4.0 * (inputs + 1)).reshape(4, -1) % 3
    c = 1.0 + np.arange(4.0 * (outputs + 1)).reshape(-1, 4) % 5
    c[-1] *= -0.02
    return sc.DelayLTI(ct.ss(a, b, c, np.zeros((outputs + 1, inputs + 1))), [0.3], name="loop")


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def _said(drawn: ct.ControlPlot) -> list[object]:
    """Everything that the panels show: curves, limits, names, grids, legends."""
    found: list[object] = []
    for ax in drawn.axes.ravel():
        found += [[line.get_xydata().tolist(), line.get_color()] for line in ax.get_lines()]
        found += [ax.get_xlim(), ax.get_ylim(), ax.get_xscale(), ax.get_yscale()]
        found += [ax.get_xlabel(), ax.get_ylabel(), ax.get_title(), [text.get_text() for text in ax.texts]]
        found += [ax.xaxis.get_majorticklocs().size > 0, ax.yaxis.get_tick_params(which="minor")]
        found += [[t.get_text() for t in ax.get_legend().get_texts()] if ax.get_legend() else None]
    return [*found, sorted(text.get_text() for text in drawn.figure.texts)]


OPTIONS = [
    {},
    {"dB": True, "Hz": True, "deg": False, "omega_limits": [1.0, 10.0]},
    {"grid": False, "title": "of my own", "color": "red", "plot_phase": False},
    {"overlay_outputs": True, "title": False},
    {"overlay_inputs": True, "legend_loc": "upper left", "plot_magnitude": False},
    {"share_magnitude": False, "share_phase": False, "share_frequency": False, "wrap_phase": True},
    {"sharex": True, "sharey": True, "title_frame": "figure", "magnitude_label": "gain"},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: "-".join(options) or "none")
def test_every_option_is_that_of_python_control(options):
    loop = _loop(2, 1) if "overlay_outputs" in options else _loop(1, 2)
    theirs = ct.bode_plot(loop.frequency_response(), **options)
    ours = loop.bode_plot(**options)
    assert type(ours) is type(theirs)
    assert ours.figure is not theirs.figure
    assert ours.lines.shape == theirs.lines.shape
    assert _said(ours) == _said(theirs)


@pytest.mark.parametrize("how", [True, "overlay"])
def test_margins_are_drawn_as_by_python_control(how):
    loop = sc.delay(0.5) * ct.tf([2.0], [1.0, 1.0, 0.3], name="L")
    theirs = ct.bode_plot(loop.frequency_response(), display_margins=how, title="Bode")
    assert _said(loop.bode_plot(display_margins=how, title="Bode")) == _said(theirs)


def test_given_axes_are_drawn_into_as_they_are():
    figure, axes = plt.subplots(2, 1)
    places = [ax.get_position().bounds for ax in axes]
    drawn = _loop(1, 1).bode_plot(ax=axes)
    assert drawn.figure is figure
    assert [ax.get_position().bounds for ax in axes] == places
    with pytest.raises(ValueError, match="frame"):
        _loop(1, 1).bode_plot(title_frame="nowhere")


@pytest.mark.parametrize(("outputs", "inputs"), [(1, 1), (4, 2), (1, 4)])
def test_nothing_overlaps_or_leaves_the_figure(outputs, inputs):
    drawn = _loop(outputs, inputs).bode_plot()
    figure = drawn.figure
    figure.canvas.draw()
    texts = [text for ax in drawn.axes.ravel() for text in (ax.xaxis.label, ax.yaxis.label, ax.title)]
    boxes = [text.get_window_extent() for text in texts if text.get_text()]
    panels = [ax.bbox for ax in drawn.axes.ravel()]
    everything = [*boxes, *panels, *(text.get_window_extent() for text in figure.texts)]
    whole = figure.bbox
    assert all(box.x0 >= 0 and box.y0 >= 0 for box in everything)
    assert all(box.x1 <= whole.x1 and box.y1 <= whole.y1 for box in everything)
    for n, box in enumerate([*boxes, *panels]):
        assert box.count_overlaps([*boxes, *panels][:n]) == 0
    names = [ax.yaxis.label.get_window_extent().x1 for ax in drawn.axes[:, 0]]
    assert np.ptp(names) < 0.01
    rows = [text for text in figure.texts if text.get_rotation()]
    assert len(rows) == (outputs if outputs * inputs > 1 else 0)
    for text, upper, lower in zip(rows, drawn.axes[::2, 0], drawn.axes[1::2, 0], strict=False):
        middle = (upper.bbox.y1 + lower.bbox.y0) / 2.0
        assert sum(text.get_window_extent().intervaly) / 2.0 == pytest.approx(middle, abs=1.0)


def test_many_panels_make_few_ticks_and_are_drawn_once(tmp_path, monkeypatch):
    """Ticks and repeated layouts were nearly all of the time of a plot of 4 outputs and 2 inputs."""
    drawn = _loop(4, 2).bode_plot()
    draws = []
    draw = type(drawn.figure).draw
    monkeypatch.setattr(
        type(drawn.figure), "draw", lambda self, renderer: (draws.append(1), draw(self, renderer))[1]
    )
    drawn.figure.savefig(tmp_path / "bode.png")
    assert len(draws) == 1
    axes = [axis for ax in drawn.axes.ravel() for axis in (ax.xaxis, ax.yaxis)]
    assert sum(len(axis.majorTicks) + len(axis.minorTicks) for axis in axes) < 15 * len(axes)
