"""A finished run as one file that can be read again: arrays as in ``.npz``, everything else as JSON beside them.

The file is a NumPy archive that is read without pickle, so that a file from elsewhere can do no harm: only the data
classes of this folder are made from it. Its member ``run`` is UTF-8 JSON; ``a0, a1, ...`` are the arrays that it
names. Numbers keep every bit.
"""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl import __version__
from susp_ctrl.delay_systems import DelayIndependence, DelaySweep, FeedbackChannel, StabilityMap
from susp_ctrl.delay_systems.crossings import DelayLine
from susp_ctrl.delay_systems.maps import MapRegions, Raster, Segments
from susp_ctrl.delay_systems.model import CharacteristicMatrix
from susp_ctrl.errors import InputError
from susp_ctrl.study.results import delay_stability, maps, pade, study_run
from susp_ctrl.study.results.study_run import StudyRun
from susp_ctrl.study.settings import Study

RESULTS = "results.npz"
"""Name of the file in the folder of a report."""


# What a run keeps as it was computed, and all data classes of this folder: a new part of a run needs no entry here.
_COMPUTED = (FeedbackChannel, DelaySweep, DelayLine, CharacteristicMatrix, DelayIndependence)
_OF_MAPS = (StabilityMap, Segments, MapRegions, Raster)
_CLASSES: dict[str, Any] = {kind.__name__: kind for kind in (*_COMPUTED, *_OF_MAPS)} | {
    name: kind
    for module in (study_run, delay_stability, maps, pade)
    for name, kind in vars(module).items()
    if is_dataclass(kind) and kind.__module__ == module.__name__
}
_KIND = "is"  # the key that tells what a JSON object stands for


def write_run(run: StudyRun, path: str | Path) -> Path:
    """Write everything that a run computed to one file.

    Parameters
    ----------
    run : StudyRun
    path : str or Path
        The file, which is replaced if it exists.

    Returns
    -------
    Path

    Raises
    ------
    OSError
        The file cannot be written.
    """
    arrays: dict[str, np.ndarray] = {}
    document = {"susp_ctrl": __version__, "run": _encoded(run, arrays)}
    text = json.dumps(document, ensure_ascii=False, allow_nan=False).encode()
    members: dict[str, Any] = {"run": np.frombuffer(text, dtype=np.uint8), **arrays}
    target = Path(path)
    with target.open("wb") as file:  # by name, numpy would append its own ending
        np.savez_compressed(file, **members)
    return target


def read_run(path: str | Path) -> StudyRun:
    """Read a run that `write_run` wrote.

    Parameters
    ----------
    path : str or Path
        The file, or the folder of a report that holds it.

    Returns
    -------
    StudyRun

    Raises
    ------
    InputError
        There is no such file, it is damaged, or another version of the program wrote it in another form.
    """
    file = Path(path)
    if file.is_dir():
        file = file / RESULTS
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        document = json.loads(arrays.pop("run").tobytes().decode())
    except FileNotFoundError:
        raise InputError(f"{path}: there are no stored results ({RESULTS})") from None
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile) as problem:
        raise InputError(f"{file}: not a file of stored results: {problem}") from None
    try:
        run = _decoded(document["run"], arrays)
    except InputError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError):
        written = document.get("susp_ctrl", "unknown") if isinstance(document, dict) else "unknown"
        raise InputError(
            f"{file}: written by version {written} in a form that version {__version__} does not read: "
            "run the study again"
        ) from None
    if not isinstance(run, StudyRun):
        raise InputError(f"{file}: holds no run of a study")
    return run


def _encoded(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Return a value as plain JSON, with its arrays put aside."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {_KIND: "float", "value": repr(value)}
    if isinstance(value, complex):
        return {_KIND: "complex", "value": [_encoded(part, arrays) for part in (value.real, value.imag)]}
    if isinstance(value, np.ndarray):
        return {_KIND: "array", "value": _put_aside(value, arrays)}
    if isinstance(value, pd.DataFrame):
        return _encoded_table(value, arrays)
    if isinstance(value, (list, tuple)):
        kind = "tuple" if isinstance(value, tuple) else "list"
        return {_KIND: kind, "value": [_encoded(item, arrays) for item in value]}
    if isinstance(value, Mapping):
        pairs = [[_encoded(key, arrays), _encoded(item, arrays)] for key, item in value.items()]
        return {_KIND: "mapping", "value": pairs}
    if isinstance(value, Study):
        parts = {"table": value.table, "file": value.file, "sha256": value.sha256}
        return {_KIND: "Study", "value": {name: _encoded(part, arrays) for name, part in parts.items()}}
    name = type(value).__name__
    if _CLASSES.get(name) is type(value):
        parts = {f.name: getattr(value, f.name) for f in fields(_CLASSES[name])}
        return {_KIND: name, "value": {name: _encoded(part, arrays) for name, part in parts.items()}}
    raise TypeError(f"a {name} cannot be stored")


def _encoded_table(table: pd.DataFrame, arrays: dict[str, np.ndarray]) -> Any:
    columns = []
    for n, name in enumerate(table.columns):
        column = table.iloc[:, n]
        plain = column.dtype.kind in "biufc" and isinstance(column.dtype, np.dtype)
        values = column.to_numpy() if plain else [None if _missing(v) else v for v in column]
        columns.append([str(name), str(column.dtype), _encoded(values, arrays)])
    return {_KIND: "table", "value": {"index": _encoded(list(table.index), arrays), "columns": columns}}


def _missing(value: Any) -> bool:
    return value is pd.NA or (isinstance(value, float) and math.isnan(value))


def _put_aside(array: np.ndarray, arrays: dict[str, np.ndarray]) -> str:
    if array.dtype.kind not in "biufcU":
        raise TypeError(f"an array of {array.dtype} cannot be stored")
    name = f"a{len(arrays)}"
    arrays[name] = array
    return name


def _decoded(value: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """Return the value that `_encoded` made JSON of."""
    if not isinstance(value, dict):
        return value
    kind, content = value[_KIND], value["value"]
    match kind:
        case "float":
            return float(content)
        case "complex":
            return complex(*(_decoded(part, arrays) for part in content))
        case "array":
            return arrays[content]
        case "table":
            return _decoded_table(content, arrays)
        case "list":
            return [_decoded(item, arrays) for item in content]
        case "tuple":
            return tuple(_decoded(item, arrays) for item in content)
        case "mapping":
            return {_decoded(key, arrays): _decoded(item, arrays) for key, item in content}
    parts = {name: _decoded(part, arrays) for name, part in content.items()}
    return Study.from_table(**parts) if kind == "Study" else _CLASSES[kind](**parts)


def _decoded_table(content: Any, arrays: Mapping[str, np.ndarray]) -> pd.DataFrame:
    index = _decoded(content["index"], arrays)
    if index == list(range(len(index))):
        index = pd.RangeIndex(len(index))
    columns = [
        pd.Series(_decoded(values, arrays), index=index, dtype=dtype, name=name)
        for name, dtype, values in content["columns"]
    ]
    return pd.concat(columns, axis=1) if columns else pd.DataFrame(index=index)
