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

import pytest

from susp_ctrl.report.page import write_page
from susp_ctrl.report.result import StudyResult
from susp_ctrl.study.result import StudyRun

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


@pytest.fixture(scope="module")
def seen(make: Callable[..., StudyRun], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    run = make(points=41, step=0.5)
    small = replace(run, tuning=(), stability=None, time=(), pade=(), audit=None)
    folder = tmp_path_factory.mktemp("browser")
    path = write_page(folder, small, StudyResult(small).sections)
    path.write_text(path.read_text(encoding="utf-8").replace("</body>", f"{_PROBE}</body>"), encoding="utf-8")
    command = [
        str(BROWSER),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={folder / 'profile'}",
    ]
    command += ["--window-size=1100,900", "--dump-dom", Path(path).as_uri()]
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
