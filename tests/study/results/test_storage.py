"""A run that is stored and read again is the same run, to the last bit; a file from elsewhere does no harm."""

from __future__ import annotations

import json
import pickle
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pandas as pd
import pytest
from map_case import map_case

import susp_ctrl as sc
from susp_ctrl.study.results.storage import RESULTS, read_run, write_run
from susp_ctrl.study.settings.study_file import Study


def assert_same(a, b, place="run"):
    assert type(a) is type(b) or {type(a), type(b)} <= {dict, type(a)}, place
    if isinstance(a, pd.DataFrame):
        pd.testing.assert_frame_equal(a, b, check_exact=True)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, place
        np.testing.assert_array_equal(a, b, strict=True)
    elif isinstance(a, Study):
        assert (a.settings, a.file, a.sha256) == (b.settings, b.file, b.sha256)
    elif is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{place}.{field.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), place
        for key in a:
            assert_same(a[key], b[key], f"{place}[{key}]")
    elif isinstance(a, (tuple, list)):
        assert len(a) == len(b), place
        for n, (left, right) in enumerate(zip(a, b, strict=True)):
            assert_same(left, right, f"{place}[{n}]")
    else:
        assert a == b or (a != a and b != b), place


def test_a_whole_run_comes_back_to_the_last_bit(small_run, tmp_path):
    extra = {
        "wheel_hop_root": -2.3 + 64.1j,
        "met": pd.DataFrame({"error": ["a", "b"], "tolerance": [0.05, 0.01], "order": [3.0, np.nan]}),
    }
    run = replace(
        small_run,
        pade=(replace(small_run.pade[0], **extra), *small_run.pade[1:]),
        headlines=("ä line with “signs” and ωτ",),
    )
    write_run(run, tmp_path / RESULTS)
    assert_same(run, read_run(tmp_path))
    assert_same(run, read_run(tmp_path / RESULTS))


def test_stability_maps_come_back(small_run, tmp_path):
    maps = (map_case("random_published"), map_case("random_published", key="gains", gain=True))
    run = replace(small_run, stability_maps=maps)
    write_run(run, tmp_path / RESULTS)
    again = read_run(tmp_path)
    assert_same(run, again)
    assert again.stability_maps[0].map.unstable_roots(0.2, [0.3, 0.5]).tolist() == [0, 2]


def test_sweeps_come_back_with_their_figures(small_run, tmp_path):
    write_run(small_run, tmp_path / RESULTS)
    for line, again in zip(small_run.stability.lines, read_run(tmp_path).stability.lines, strict=True):
        assert_same(line.sweep.figure_data, again.sweep.figure_data)


def test_infinite_and_missing_numbers_come_back(small_run, tmp_path):
    stability = small_run.stability
    line = stability.lines[0]
    sweep = replace(line.sweep, delay_margin=np.inf, up_to=float("nan"))
    line = replace(line, sweep=sweep, tau_of_design=None)
    run = replace(small_run, stability=replace(stability, lines=(line,)))
    write_run(run, tmp_path / RESULTS)
    again = read_run(tmp_path).stability.lines[0]
    assert again.sweep.delay_margin == np.inf
    assert again.tau_of_design is None
    assert np.isnan(again.sweep.up_to)


def test_missing_and_damaged_files_are_one_line(small_run, tmp_path):
    path = tmp_path / RESULTS
    with pytest.raises(sc.InputError, match="no stored results"):
        read_run(tmp_path)
    path.write_bytes(b"no archive")
    with pytest.raises(sc.InputError, match="not a file of stored results"):
        read_run(tmp_path)
    write_run(small_run, path)
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(sc.InputError, match="not a file of stored results"):
        read_run(tmp_path)


class Harmful:
    def __reduce__(self):
        return (pytest.fail, ("the file ran code",))


def test_a_file_from_elsewhere_runs_no_code(tmp_path):
    path = tmp_path / RESULTS
    np.savez(path, run=np.array([Harmful()], dtype=object))
    with pytest.raises(sc.InputError, match="not a file of stored results"):
        read_run(path)
    path.write_bytes(pickle.dumps({"harmless": 1}))
    with pytest.raises(sc.InputError, match="not a file of stored results"):
        read_run(path)


@pytest.mark.parametrize(
    "run",
    [
        {"is": "Popen", "value": {}},
        {"is": "StudySettings", "value": {}},
        {"is": "StudyRun", "value": {"old": 1}},
        3,
        None,
    ],
)
def test_another_form_names_the_version_that_wrote_it(tmp_path, run):
    text = json.dumps({"susp_ctrl": "9.9", "run": run}).encode()
    np.savez(tmp_path / RESULTS, run=np.frombuffer(text, dtype=np.uint8))
    with pytest.raises(sc.InputError, match=r"version 9\.9|holds no run"):
        read_run(tmp_path)


def test_what_cannot_be_stored_is_an_error_and_no_loss(small_run, tmp_path):
    with pytest.raises(TypeError, match="set cannot be stored"):
        write_run(replace(small_run, headlines={"a"}), tmp_path / RESULTS)
    assert not (tmp_path / RESULTS).exists()
