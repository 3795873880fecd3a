"""Stability maps as drawn: shades by rank, every curve in full, and the picture of the regions alone."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from susp_ctrl import plotting

X, Y = np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3)
# A loop of four segments, and a line of three that are given in any order and direction.
LOOP = [[[0, 0], [1, 0]], [[1, 1], [1, 0]], [[1, 1], [0, 1]], [[0, 0], [0, 1]]]
LINE = [[[5, 5], [6, 5]], [[4, 5], [3, 5]], [[4, 5], [5, 5]]]
# Three lines that meet in one point.
STAR = [[[9, 9], [8, 8]], [[9, 9], [8, 9]], [[9, 8], [9, 9]]]


@pytest.fixture
def ax() -> Axes:
    axes: Axes = Figure().subplots()
    return axes


def legend(ax: Axes) -> list[str]:
    found = ax.get_legend()
    assert found is not None
    return [text.get_text() for text in found.get_texts()]


def undirected(segments: np.ndarray) -> set[frozenset[tuple[float, ...]]]:
    return {frozenset(map(tuple, segment)) for segment in segments.tolist()}


@pytest.mark.parametrize("parts", [[LOOP], [LINE], [STAR], [LOOP, LINE, STAR], [STAR, LINE, LOOP]])
def test_curves_are_drawn_in_full_whatever_their_order(ax: Axes, parts: list[list[list[list[int]]]]) -> None:
    given = np.array([segment for part in parts for segment in part], dtype=float)
    plotting.draw_stability_map(X, Y, np.zeros((3, 5), int), given, ax)
    line = np.asarray(ax.get_lines()[0].get_xydata())
    drawn = np.stack([line[:-1], line[1:]], axis=1)
    drawn = drawn[np.isfinite(drawn).all(axis=(1, 2))]
    assert undirected(drawn) == undirected(given)
    assert len(drawn) == len(given)


def test_a_long_line_is_one_piece(ax: Axes) -> None:
    points = np.column_stack([np.linspace(0.0, 1.0, 200), np.linspace(0.0, 1.0, 200) ** 2])
    segments = np.stack([points[:-1], points[1:]], axis=1)
    shuffled = np.random.default_rng(1).permutation(segments)
    plotting.draw_stability_map(X, Y, np.zeros((3, 5), int), shuffled, ax)
    line = np.asarray(ax.get_lines()[0].get_xydata())
    assert np.isnan(line[:, 0]).sum() == 1
    assert len(line) == 201


def test_shades_grow_with_the_numbers_and_only_stable_is_white(ax: Axes) -> None:
    numbers = np.array([[0, 2, 4, 6, 8], [10, 12, 14, 16, 18], [0, 0, 0, 0, 2]])
    plotting.draw_stability_map(X, Y, numbers, np.zeros((0, 2, 2)), ax, design=(1.0, 0.5))
    assert legend(ax) == [
        "stable",
        *(f"{n} unstable roots" for n in (2, 4, 6, 8, 10)),
        "12 to 18 unstable roots",
        "design",
    ]
    picture = np.asarray(ax.get_images()[0].get_array())[:, :, 0].astype(int)
    assert (picture[0, 1:] < picture[0, :-1]).all()
    assert (picture == 255).sum() == (numbers == 0).sum()
    assert len(set(picture[1, 1:])) == 1


def test_without_a_stable_region_nothing_is_white() -> None:
    assert plotting.map_legend([[2, 4]]) == [("2 unstable roots", "#E2E2E2"), ("4 unstable roots", "#C9C9C9")]
    assert plotting.map_legend([[1, 0]])[1][0] == "1 unstable root"


def test_undecided_places_are_hatched_and_not_stable(ax: Axes) -> None:
    plotting.draw_stability_map(X, Y, np.full((3, 5), -1), np.zeros((0, 2, 2)), ax)
    assert legend(ax) == ["undecided"]
    assert (np.asarray(ax.get_images()[0].get_array())[:, :, 3] == 0).all()


def test_the_picture_has_a_dot_for_each_value_and_its_first_row_below() -> None:
    numbers = np.array([[0, 0, 2], [4, 4, 4]])
    picture = Image.open(BytesIO(plotting.map_picture(numbers))).convert("L")
    dots = np.asarray(picture)
    assert dots.shape == (2, 3)
    assert dots[1].tolist() == [255, 255, 0xE2]
    assert dots[0].tolist() == [0xC9] * 3
    undecided = Image.open(BytesIO(plotting.map_picture([[0, -1]])))
    assert np.asarray(undecided)[0, :, 3].tolist() == [255, 0]


def test_a_design_outside_is_not_marked_and_a_limit_is_drawn(ax: Axes) -> None:
    limit = (X, [0.5, np.nan, 0.4, 0.3, 0.2])
    plotting.draw_stability_map(
        X, Y, np.zeros((3, 5), int), LINE, ax, design=(3.0, 0.5), limit=limit, limit_label="highest"
    )
    assert legend(ax) == ["stable", "highest"]
    np.testing.assert_array_equal(ax.get_lines()[1].get_ydata(), limit[1])
    assert (ax.get_xlim(), ax.get_ylim()) == ((0.0, 2.0), (0.0, 1.0))
