"""A certificate is checked by one file that knows nothing of the package, and no altered digit passes."""

from __future__ import annotations

import ast
import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import susp_ctrl as sc
from susp_ctrl.delay_systems.proof import check_certificate

FILE = Path(check_certificate.__file__)


def half_car():
    channels = [
        sc.FeedbackChannel("unsprung_displacement_front", "force_front", 19345.0, 0.5530),
        sc.FeedbackChannel("unsprung_displacement_rear", "force_rear", 26150.0, 0.5186),
    ]
    return sc.close_loop(sc.HalfCar().plant(), channels)


def unstable():
    return sc.DelayLTI.from_state_delays(A=[[[0.0]], [[-1.7]]], delays=[1.0])


def signed(data):
    """The text with a digest that fits it."""
    data = {key: value for key, value in data.items() if key != "sha256"}
    digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
    return json.dumps({**data, "sha256": digest})


def test_the_checker_imports_nothing_of_the_package():
    tree = ast.parse(FILE.read_text(encoding="utf-8"))
    imported = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    imported |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert imported <= {"hashlib", "itertools", "json", "sys", "pathlib", "typing", "flint"}


@pytest.mark.end_to_end
def test_the_checker_stands_alone(tmp_path):
    path = tmp_path / "certificate.json"
    path.write_text(sc.prove_stability(half_car()).certificate(), encoding="utf-8")
    told = subprocess.run(
        [sys.executable, "-I", str(FILE), str(path)], capture_output=True, text=True, check=True
    )
    assert told.stdout == "proven: 0 roots with real part above 0 rad/s\n"


@pytest.mark.parametrize(
    ("system", "arguments", "roots"),
    [
        (half_car, {"right_of": -1.0}, 0),
        (half_car, {"right_of": -2.0}, 4),
        (half_car, {"delays": [(0.545, 0.56), None], "gains": [None, (26000.0, 26300.0)]}, 0),
        (unstable, {}, 2),
        (unstable, {"gains": [(0.95, 1.1)], "delays": [(1.0, 1.2)]}, 2),
    ],
)
def test_lines_and_boxes(system, arguments, roots):
    proof = sc.prove_stability(system(), **arguments)
    assert check_certificate.check(proof.certificate()).startswith(f"proven: {roots} roots")


def test_a_box_of_many_parts():
    """The wide box of x' = -g x(t - tau), g tau below pi/2, in parts that the checker joins again."""
    proof = sc.prove_stability(unstable(), gains=[(0.05, 0.9)], delays=[(0.01, 1.0)])
    assert proof.stable is True
    assert proof.boxes > 1
    assert "split" in json.loads(proof.certificate())["parts"]
    check_certificate.check(proof.certificate())


def test_no_altered_digit_passes():
    text = sc.prove_stability(unstable()).certificate()
    for place in [match.start() for match in re.finditer(r"[0-9]", text)][::3]:
        other = str((int(text[place]) + 1) % 10)
        with pytest.raises((ValueError, KeyError, TypeError)):
            check_certificate.check(text[:place] + other + text[place + 1 :])


def test_a_false_claim_with_a_digest_that_fits_is_refused():
    data = json.loads(sc.prove_stability(half_car()).certificate())
    thinner = data["centre"][:1] + data["centre"][4:]
    for change in (
        {"roots": 2},
        {"centre": thinner},
        {"centre": data["centre"][: len(data["centre"]) // 2]},
        {"centre": data["centre"][1:]},
        {"right_of": (-1.2).hex()},
        {"delays": [[(0.0).hex(), (1.0).hex()], data["delays"][1]], "parts": {"points": data["centre"]}},
        {"gains": [[(1e5).hex()] * 2, data["gains"][1]]},
        {"format": "another"},
    ):
        with pytest.raises(ValueError, match="not proven"):
            check_certificate.check(signed(data | change))


def test_without_a_proof_there_is_no_certificate():
    with pytest.raises(sc.InputError, match="no certificate: nothing is proven"):
        sc.prove_stability(half_car(), most_intervals=2).certificate()
