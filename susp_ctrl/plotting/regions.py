"""Stability maps: regions of equal number of unstable roots, crossing curves, and where the design lies."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from susp_ctrl.plotting.style import BLACK, axes_for, curve_style, finished, styled

# White for stable, then darker with the number of unstable roots; the last shade stands for all larger numbers.
_SHADES = ("#FFFFFF", "#E2E2E2", "#C9C9C9", "#B2B2B2", "#9C9C9C", "#878787", "#737373")


@styled
def draw_stability_map(
    x: ArrayLike,
    y: ArrayLike,
    unstable_roots: ArrayLike,
    curves: ArrayLike,
    ax: Axes | None = None,
    *,
    xlabel: str = "delay 1 (s)",
    ylabel: str = "delay 2 (s)",
    design: tuple[float, float] | None = None,
    limit: tuple[ArrayLike, ArrayLike] | None = None,
    limit_label: str = "limit",
    title: str | None = None,
) -> Axes:
    """Draw regions shaded by their number of unstable roots, and the crossing curves between them.

    Parameters
    ----------
    x, y
        Values along the axes, shapes (n,) and (m,), equally spaced.
    unstable_roots
        Number of unstable roots, shape (m, n); negative means undecided.
    curves
        Segments of the crossing curves, shape (k, 2, 2): segment, end, coordinate.
    ax
        Axes to draw into; new ones by default.
    xlabel, ylabel
        Names and units of the axes.
    design
        A point to mark.
    limit, limit_label
        A line (x, y) drawn boldly over the curves, nan where it has none, and its meaning.
    title
        Title of the axes.

    Returns
    -------
    Axes
    """
    ax = axes_for(ax)
    numbers = np.asarray(unstable_roots)
    columns, rows = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    rank, names = _ranks(numbers)
    # Points are the middles of the picture's dots, which reach half a step beyond the first and the last.
    step_x, step_y = (columns[-1] - columns[0]) / (columns.size - 1), (rows[-1] - rows[0]) / (rows.size - 1)
    edges = (
        columns[0] - step_x / 2, columns[-1] + step_x / 2, rows[0] - step_y / 2, rows[-1] + step_y / 2,
    )  # fmt: skip
    ax.imshow(_picture(rank), origin="lower", extent=edges, aspect="auto", interpolation="none", zorder=0.5)
    line = _chained(np.asarray(curves, dtype=float).reshape(-1, 2, 2))
    ax.plot(line[:, 0], line[:, 1], color=BLACK, linewidth=0.6, marker="")
    handles: list[Any] = [
        Patch(facecolor=shade, edgecolor=BLACK, linewidth=0.5, label=text) for text, shade in names
    ]
    if (rank < 0).any():
        ax.patch.set_hatch("....")
        handles.append(
            Patch(facecolor="white", edgecolor=BLACK, linewidth=0.5, hatch="....", label="undecided")
        )
    if limit is not None:
        look = {**curve_style(1), "linestyle": "-", "linewidth": 2.2, "marker": ""}
        handles += ax.plot(np.asarray(limit[0]), np.asarray(limit[1]), label=limit_label, **look)
    if design is not None and columns[0] <= design[0] <= columns[-1] and rows[0] <= design[1] <= rows[-1]:
        handles += ax.plot(
            *design, marker="X", color="white", markeredgecolor=BLACK, markeredgewidth=1.0, markersize=8,
            linestyle="", label="design", clip_on=False, zorder=5,
        )  # fmt: skip
    ax.set_xlim(columns[0], columns[-1])
    ax.set_ylim(rows[0], rows[-1])
    ax.grid(visible=False)
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, handlelength=2.0)
    return finished(ax, xlabel, ylabel, title)


def map_picture(unstable_roots: ArrayLike) -> bytes:
    """Return the regions alone as a PNG, one dot for each value, the first row at the bottom.

    Parameters
    ----------
    unstable_roots
        Number of unstable roots, shape (m, n); negative means undecided.
    """
    rank, _ = _ranks(np.asarray(unstable_roots))
    picture = Image.fromarray(_picture(rank)[::-1])
    if not (rank < 0).any():  # a palette is smaller, but knows no transparency
        picture = picture.convert("RGB").convert("P", palette=Image.Palette.ADAPTIVE, colors=len(_SHADES))
    file = BytesIO()
    picture.save(file, format="PNG", optimize=True)
    return file.getvalue()


def map_legend(unstable_roots: ArrayLike) -> list[tuple[str, str]]:
    """Return the texts and shades (``"#RRGGBB"``) of the regions of a map."""
    return _ranks(np.asarray(unstable_roots))[1]


def _ranks(numbers: NDArray[Any]) -> tuple[NDArray[np.int_], list[tuple[str, str]]]:
    """Return the shade number of each value (-1: undecided), and the text of every shade used."""
    present = [int(value) for value in np.unique(numbers) if value >= 0]
    shades = {
        value: min(place + (0 if 0 in present else 1), len(_SHADES) - 1)
        for place, value in enumerate(present)
    }
    rank = np.full(numbers.shape, -1)
    for value, shade in shades.items():
        rank[numbers == value] = shade
    names = []
    for shade in sorted(set(shades.values())):
        values = [value for value in present if shades[value] == shade]
        text = f"{values[0]} unstable root{'s' if values[0] != 1 else ''}" if values[0] else "stable"
        names.append(
            (text if len(values) == 1 else f"{values[0]} to {values[-1]} unstable roots", _SHADES[shade])
        )
    return rank, names


def _picture(rank: NDArray[np.int_]) -> NDArray[np.uint8]:
    """Return the shades as RGBA, transparent where undecided."""
    colours = np.array([[*to_rgb(shade), 1.0] for shade in _SHADES] + [[1.0, 1.0, 1.0, 0.0]])
    return np.asarray(np.rint(255.0 * colours[rank]), dtype=np.uint8)


def _chained(segments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return segments as few long lines with nan between them: files of dense curves become several times smaller.

    Lines go on through the ends that exactly two segments share, whichever way each of the two runs.
    """
    count = len(segments)
    if count == 0:
        return np.zeros((0, 2))
    points, node = np.unique(segments.reshape(-1, 2), axis=0, return_inverse=True)
    node = node.reshape(-1)
    degree = np.bincount(node)
    by_node = np.argsort(node, kind="stable")
    first = (np.cumsum(degree) - degree).tolist()
    ends, at, two = node.reshape(-1, 2).tolist(), (by_node // 2).tolist(), (degree == 2).tolist()
    new = [True] * count
    # Lines from their ends first; what is left then are loops.
    open_ends = np.flatnonzero(~np.array(two)[node]) // 2
    line: list[int] = []
    for start in [*open_ends.tolist(), *range(count)]:
        if not new[start]:
            continue
        here = ends[start][0] if not two[ends[start][0]] else ends[start][1]
        if two[here]:
            here = ends[start][0]
        line += [-1, here]
        segment = start
        while True:
            new[segment] = False
            here = ends[segment][1] if ends[segment][0] == here else ends[segment][0]
            line.append(here)
            if not two[here]:
                break
            one, other = at[first[here]], at[first[here] + 1]
            segment = other if one == segment else one
            if not new[segment]:
                break
    chosen: NDArray[np.float64] = np.vstack([points, [[np.nan, np.nan]]])[line]
    return chosen
