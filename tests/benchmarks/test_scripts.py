"""Each benchmark script runs on its own, here at a tiny size, and prints its table. No time is asserted."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest


def lines_of(script, *arguments):
    command = [sys.executable, str(Path(__file__).parent / script), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.end_to_end
def test_delay_systems():
    lines = lines_of("delay_systems.py", "--points", "40", "--grid", "8", "--sample", "4", "--repeat", "1")
    for peer in ("4 x 4 solves", "8 x 8 solves", "Padé", "Chebyshev", "full state, all roots"):
        (first, *_) = [line for line in lines if peer in line]
        assert re.search(r"\d (ms|s) .*\d x ", first), first
    same = next(line for line in lines if "8 x 8 solves" in line).split()[-1]
    assert float(same) < 1e-10
    assert all(" 0 of " in line for line in lines if "differ" in line and "difference" not in line)


@pytest.mark.end_to_end
def test_tuning():
    lines = lines_of(
        "tuning.py", "--seeds", "1", "--particles", "10", "--iterations", "3", "--objectives", "road_rms"
    )
    assert any(line.startswith("road_rms: best known 0.7") for line in lines)
    for method in ("susp_ctrl.tune", "scipy differential evolution"):
        (row,) = [line for line in lines if line.strip().startswith(method)]
        assert re.search(r"[01]/1 .* ms .* x$", row), row


@pytest.mark.end_to_end
def test_hard_cases():
    lines = lines_of("hard_cases.py", "--row", "smith", "--row", "large", "--states", "30")
    rows = [line for line in lines if "stable" in line]
    assert len(rows) == 9
    assert all("stable True" in row for row in rows)
