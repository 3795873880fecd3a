"""The HTML page in a real browser without a window: it runs without errors, zooms, and asks for nothing."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from map_case import POINTS, map_case, map_explorer

from susp_ctrl.report.page import write_page
from susp_ctrl.report.study_result import StudyResult
from susp_ctrl.study.results.study_run import StudyRun

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.skipif(BROWSER is None, reason="no chromium here"),
]

_PROBE = """
<script>
const seen = {errors: [], boxes: []};
window.addEventListener("error", event => seen.errors.push(event.message));
const plot = document.querySelector(".plot"), svg = plot.querySelector("svg");
const box = () => svg.getAttribute("viewBox").split(/[ ,]+/).map(Number);
const [nearer, farther, reset] = plot.querySelectorAll("button");
const turn = {deltaY: -1, clientX: 200, clientY: 400, cancelable: true};
const wheel = () => svg.dispatchEvent(new WheelEvent("wheel", turn));
const note = () => seen.boxes.push(box());
note(); nearer.click(); note(); farther.click(); note(); reset.click(); note();
document.body.click(); wheel(); note();
svg.dispatchEvent(new MouseEvent("click", {bubbles: true})); wheel(); note();
reset.click(); note();
seen.requests = performance.getEntriesByType("resource").map(entry => entry.name);
seen.wide = document.documentElement.scrollWidth <= window.innerWidth;
document.body.dataset.seen = JSON.stringify(seen);
</script>
"""


_MAP_PROBE = """
<script>
const seen = {errors: [], states: []};
window.addEventListener("error", event => seen.errors.push(event.message));
const explorer = document.querySelector(".explorer"), map = explorer.querySelector(".map");
const area = map.querySelector("image").getBoundingClientRect();
const note = () => seen.states.push({
  says: explorer.querySelector(".says").textContent,
  loop: explorer.querySelector(".loop").getAttribute("points"),
  passive: explorer.querySelector(".passive").getAttribute("points"),
  mark: explorer.querySelector(".mark").getBoundingClientRect().left,
});
const click = (x, y) => map.dispatchEvent(new MouseEvent("click",
  {bubbles: true, clientX: area.left + x * area.width, clientY: area.bottom - y * area.height}));
const press = key => map.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true, cancelable: true}));
note(); click(0.74, 0.26); note(); click(0.02, 0.97); note(); press("ArrowDown"); note(); press("ArrowLeft"); note();
click(0.99, 0.99); note();
const names = performance.getEntriesByType("resource").map(entry => entry.name);
seen.requests = names.filter(name => !name.startsWith("data:"));
seen.wide = document.documentElement.scrollWidth <= window.innerWidth;
document.body.dataset.seen = JSON.stringify(seen);
</script>
"""


@pytest.fixture(scope="module")
def seen(make: Callable[..., StudyRun], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    run = make(points=41, step=0.5)
    small = replace(run, tuning=(), stability=None, time=(), pade=(), audit=None)
    folder = tmp_path_factory.mktemp("browser")
    path = write_page(folder, small, StudyResult(small).sections)
    return _visit(path, _PROBE)


@pytest.fixture(scope="module")
def clicked(make: Callable[..., StudyRun], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    case = map_case("second_published")
    run = replace(make(points=41, step=0.5), stability_maps=(case,))
    small = replace(run, tuning=(), stability=None, time=(), pade=(), audit=None, frequency=None)
    folder = tmp_path_factory.mktemp("map")
    path = write_page(folder, small, StudyResult(small).sections, explorers=[map_explorer(case)])
    return _visit(path, _MAP_PROBE)


def _visit(path: Path, probe: str) -> dict[str, Any]:
    """Open the page with a script of the test at its end, and return what that script saw."""
    path.write_text(path.read_text(encoding="utf-8").replace("</body>", f"{probe}</body>"), encoding="utf-8")
    command = [
        str(BROWSER),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={path.parent / 'profile'}",
    ]
    command += ["--window-size=1100,900", "--dump-dom", path.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = re.search(r'data-seen="([^"]*)"', done.stdout)
    assert found, "the script of the test did not run to its end"
    result: dict[str, Any] = json.loads(unescape(found.group(1)))
    return result


def test_no_error_and_no_request(seen: dict[str, Any]) -> None:
    assert seen["errors"] == []
    assert seen["requests"] == []
    assert seen["wide"], "the page must not scroll sideways"


def test_plots_zoom_by_buttons_and_by_wheel_after_a_click(seen: dict[str, Any]) -> None:
    start, nearer, back, reset, wheel_without_click, wheel_after_click, end = seen["boxes"]
    assert nearer[2] == pytest.approx(0.7 * start[2])
    assert nearer[3] == pytest.approx(0.7 * start[3])
    assert nearer[0] > start[0]
    assert back == pytest.approx(start)
    assert reset == pytest.approx(start)
    assert wheel_without_click == pytest.approx(start)
    assert wheel_after_click[2] == pytest.approx(0.85 * start[2])
    assert end == pytest.approx(start)


def test_a_click_on_the_map_shows_the_root_and_the_response_there(clicked: dict[str, Any]) -> None:
    assert clicked["errors"] == []
    assert clicked["requests"] == []
    assert clicked["wide"]
    explorer = map_explorer(map_case("second_published"))
    # The point nearest to the design first, then the points clicked, and one step down from the last.
    for state, (row, column) in zip(
        clicked["states"], [(1, 1), (1, 3), (4, 0), (3, 0), (3, 0)], strict=False
    ):
        says = state["says"].replace("−", "-")
        assert f"τ₁ = {explorer.x_values[column]:.4g} s, τ₂ = {explorer.y_values[row]:.4g} s" in says
        root = explorer.roots[row, column]
        shown = re.search(r"rightmost root (\S+) ± (\S+)j", says)
        assert shown
        assert complex(*map(float, shown.groups())) == pytest.approx(root, rel=1e-4, abs=1e-4)
        assert ("unstable, 2 unstable roots" in says) == (root.real > 0)
        assert ("— stable" in says) == (root.real < 0)
        _check_curve(state["loop"], explorer.responses[row, column])
        _check_curve(state["passive"], explorer.passive)
    marks = [state["mark"] for state in clicked["states"]]
    assert marks[1] > marks[0] > marks[2]


def test_an_endless_response_is_said_and_not_drawn(clicked: dict[str, Any]) -> None:
    last = clicked["states"][-1]
    assert "leaves the range of numbers" in last["says"]
    assert last["loop"] == ""
    assert len(map_explorer(map_case("second_published")).x_values) == POINTS


def _check_curve(points: str, values: np.ndarray) -> None:
    """The drawn curve is the response: equal up to a scale and a shift (its axis may clip nothing here)."""
    drawn = np.array([point.split(",") for point in points.split()], dtype=float)
    assert len(drawn) == values.size
    assert np.allclose(np.diff(drawn[:, 0], 2), 0.0, atol=0.21)
    shift, scale = np.linalg.lstsq(np.column_stack([np.ones(values.size), values]), drawn[:, 1], rcond=None)[
        0
    ]
    assert shift == pytest.approx(127.5, abs=0.2)
    assert scale < 0  # upwards on the screen
    assert abs(shift + scale * values - drawn[:, 1]).max() < 0.2
