r"""How much work a study is, predicted from its settings before anything is computed.

A cell is about a microsecond. All characteristic roots of a loop with :math:`\mathrm{Re}\, s \ge 0` lie within
:math:`|s| \le P`, the spectral radius of :math:`|A| + \sum_k |A_k|`, so :math:`P \tau` counts the waves that the delay
:math:`\tau` holds: with it grow roots, crossings and the matrices that approximate the delay. The other numbers were
measured; they are meant to be too large rather than too small.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import pi, prod
from typing import Any

import control
import numpy as np

from susp_ctrl.arrays import FloatArray
from susp_ctrl.study.settings.fields import MISSING, SettingError
from susp_ctrl.study.settings.maps import MapSettings
from susp_ctrl.study.settings.simulation import TimeSettings
from susp_ctrl.study.settings.study import StudySettings

MOST_CELLS = 1e9
"""Predicted work of a whole study, but for its variants, that is taken."""

MOST_VARIANT_CELLS = 1e11
"""Predicted work of all variants of a sweep: they are computed side by side, and each is kept."""

_ROAD_WAVENUMBER = 2.83  # cycle/m, where random roads end
_BINS = 300  # of a random road, by default


@dataclass(frozen=True)
class _Loop:
    """A loop as the prediction sees it: sizes of its gains, P (rad/s) and longest delay (s)."""

    gains: tuple[float, ...]
    radius: float
    delay: float

    @property
    def channels(self) -> int:
        return len(self.gains)

    @property
    def waves(self) -> float:
        return self.radius * self.delay

    @property
    def verdict(self) -> float:
        return 1e4 + 3e3 * self.channels**2 * self.waves + 10.0 * self.waves**2

    def line(self, waves: float) -> float:
        """Sweep of the delays along a line with so many waves."""
        return 1e4 + 50.0 * self.channels**2 * waves * (1.0 + waves / 1e6)


def check_work(study: StudySettings, plant: control.StateSpace) -> None:
    """Refuse a study that would not end in reasonable time.

    Raises
    ------
    SettingError
        The section with most work, and how many cells it is.
    """
    loops = _loops(study, plant)
    cells = predicted_cells(study, loops)
    if sum(cells.values()) > MOST_CELLS:
        # the first that is too much by itself: what follows may only repeat it
        most = next(
            (name for name, one in cells.items() if one > MOST_CELLS), max(cells, key=cells.__getitem__)
        )
        raise _too_much(most, cells[most], MOST_CELLS)
    if study.sweep is not None:
        chosen = study.sweep.designs or list(loops)
        one = sum(loops[key].verdict + loops[key].line(100.0) if key in loops else 1e4 for key in chosen)
        if study.sweep.retune:
            one += sum(cells[f"tuning[{search.key}]"] for search in study.tuning)
        if study.sweep.variants * one > MOST_VARIANT_CELLS:
            raise _too_much("sweep", study.sweep.variants * one, MOST_VARIANT_CELLS)


def predicted_cells(study: StudySettings, loops: dict[str, _Loop]) -> dict[str, float]:
    """Return the predicted work by section."""
    every = list(loops.values())
    cells: dict[str, float] = {}
    if study.frequency is not None:
        cells["frequency"] = 3.0 * study.frequency.points * (len(every) + 1)
    for search in study.tuning:
        loop, pairs = loops[search.key], len(search.pairs)
        tests = search.particles * (search.iterations + 1.0) * pairs * (100.0 * pairs + loop.waves)
        cells[f"tuning[{search.key}]"] = tests + loop.verdict * (
            1 + len(search.compare) + len(search.detuning)
        )
    if (lines := study.stability) is not None:
        ends = {"ray": lambda loop: lines.ray_up_to * loop.waves}
        cells["stability"] = sum(
            loop.verdict * (1.0 + lines.roots / 50.0)
            + sum(loop.line(ends[n](loop) if n in ends else loop.radius * lines.up_to) for n in lines.lines)
            for loop in every
        )
    for entry in study.stability_maps:
        cells[f"stability_maps[{entry.key}]"] = sum(
            _map_cells(entry, loops[key]) for key in entry.designs or loops
        )
    speed = study.vehicle.speed
    for case in study.time:
        chosen = [loops[key] for key in case.designs]
        cells[f"time[{case.key}]"] = _run_cells(case, speed, chosen) + _stationary_cells(case, speed, chosen)
    if study.pade is not None:
        orders = study.pade.orders
        cases = {case.key: case for case in study.time}
        total = 0.0
        for key, name in study.pade.cases.items():
            loop = loops[key]
            size = sum(1.0 + loop.channels * order / 8.0 for order in orders)
            again = 1 + study.pade.cost_repeats
            total += size * again * _run_cells(cases[name], speed, [loop]) + loop.verdict * len(orders)
            total += 10.0 * study.pade.points * size
        total += sum(loops[key].verdict * len(orders) for key in study.pade.verdicts)
        cells["pade"] = total
    return cells


def _run_cells(case: TimeSettings, speed: float, loops: Sequence[_Loop]) -> float:
    """Simulations of the passive car and of every design, exactly and with Padé, over lead-in and record."""
    time, samples = case.lead_in + case.duration, case.duration / case.step
    per_second = 10.0
    if case.road.kind == "random":
        highest = 2.0 * pi * _ROAD_WAVENUMBER * speed
        per_second += 0.015 * (case.road.bins or _BINS) * (highest + 100.0)
    elif case.road.omega is not None:
        per_second += 3.0 * case.road.omega
    return (2 * len(loops) + 1) * (samples * (2.0 + 0.2 * len(case.outputs)) + time * per_second)


def _stationary_cells(case: TimeSettings, speed: float, loops: Iterable[_Loop]) -> float:
    if case.road.kind == "bump":
        return sum(loop.verdict for loop in loops)
    highest = 2.0 * pi * _ROAD_WAVENUMBER * speed
    return sum(loop.verdict + 1e3 * (loop.radius + highest) * loop.delay for loop in loops)


def _map_cells(entry: MapSettings, design: _Loop) -> float:
    """Curves of a map, and what a click on it shows."""
    delays = [entry.range(name)[1] for name in entry.free if name.startswith("tau")]
    growth = max(entry.gain_factor, 1.0)
    for name in entry.free:
        if name.startswith("gain") and entry.channel(name) < design.channels:
            widest = max(abs(end) for end in entry.range(name))
            growth = max(growth, widest / max(design.gains[entry.channel(name)], 1e-3 * widest))
    # P grows with the root of a gain upon a mass, and with the gain of an actuator of finite bandwidth
    loop = _Loop(design.gains, design.radius * growth**0.5, max([*delays, design.delay]))
    axes = [loop.radius * delay for delay in delays] + [100.0] * (2 - len(delays))
    cells = 1e5 + 12.0 * prod(axes) + loop.verdict
    if entry.explorer is not None:
        instants = entry.explorer.duration / entry.explorer.step
        cells += entry.explorer.points**2 * (5e3 + 5.0 * instants + 100.0 * loop.waves)
    return cells


def _loops(study: StudySettings, plant: control.StateSpace) -> dict[str, _Loop]:
    """Return every design, and every search at the widest corner of its bounds."""
    given: dict[str, list[Any]] = {design.key: list(design.channels) for design in study.designs}
    given |= {search.key: [pair.widest for pair in search.pairs] for search in study.tuning}
    return {
        key: _Loop(
            tuple(abs(channel.gain) for channel in channels),
            _radius(plant, channels),
            max(channel.delay for channel in channels),
        )
        for key, channels in given.items()
    }


def _radius(plant: control.StateSpace, channels: Sequence[Any]) -> float:
    """Return the spectral radius of |A| + sum |A_k|; every actuator of finite bandwidth is one more state."""
    A, B, C, D = (np.abs(np.asarray(part, dtype=float)) for part in (plant.A, plant.B, plant.C, plant.D))
    slow = [channel for channel in channels if channel.actuator_bandwidth is not None]
    n = A.shape[0]
    M: FloatArray = np.zeros((n + len(slow), n + len(slow)))
    M[:n, :n] = A
    inputs = {channel.actuator: plant.input_labels.index(channel.actuator) for channel in channels}
    through = [inputs[channel.actuator] for channel in slow]
    M[:n, n:] = B[:, through]
    for channel in channels:
        output = plant.output_labels.index(channel.measured)
        felt = abs(channel.gain) * np.concatenate([C[output], D[output, through]])
        if channel.actuator_bandwidth is None:
            M[:n] += np.outer(B[:, inputs[channel.actuator]], felt)
        else:
            row = n + slow.index(channel)
            M[row] += channel.actuator_bandwidth * felt
            M[row, row] += channel.actuator_bandwidth
    return float(np.max(np.abs(np.linalg.eigvals(M))))


def _too_much(section: str, cells: float, most: float) -> SettingError:
    allowed = (
        f"about {cells:.1e} cells of work (1e6 are a second) are predicted, at most {most:.0e} are allowed"
    )
    return SettingError(section, MISSING, allowed)
