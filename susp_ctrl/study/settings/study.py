"""The settings of a study: what a study file can say, with units, limits and defaults.

Defaults are those of the source paper where it gives them. A section that is not given is not run.
"""

# ruff: noqa: RUF009  setting() makes a dataclass field
from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from susp_ctrl.study.settings.audit import AuditSettings
from susp_ctrl.study.settings.fields import KEY, SettingError, Settings, nearest, setting
from susp_ctrl.study.settings.maps import MapSettings
from susp_ctrl.study.settings.simulation import ISO_CLASSES, PadeSettings, TimeSettings, check_band
from susp_ctrl.study.settings.variants import SweepSettings
from susp_ctrl.study.settings.vehicle import BoxSettings, DesignSettings, PairSettings, VehicleSettings
from susp_ctrl.tuning.swarm import TOPOLOGIES

# What each objective of a search needs to be told.
_OBJECTIVES = {
    "harmonic": ("omega",),
    "band_mean": ("omega_from", "omega_to"),
    "band_peak": ("omega_from", "omega_to"),
    "road_rms": ("iso_class",),
}


@dataclass(frozen=True)
class FrequencySettings(Settings):
    """Frequency responses; |H| per road velocity of eq. (6) for `curve_designs` (all designs if empty).

    By default `outputs` are the ride indicators of the vehicle and `curve_outputs` its heave and pitch acceleration.
    """

    omega_from: float = setting(0.5, unit="rad_per_s", above=0.0)
    omega_to: float = setting(150.0, unit="rad_per_s", above=0.0)
    points: int = setting(1500, at_least=10, at_most=200_000)
    outputs: tuple[str, ...] = setting(())
    curve_outputs: tuple[str, ...] = setting(())
    curve_designs: tuple[str, ...] = setting(())

    def check(self) -> None:
        """Refuse an empty band."""
        check_band(self.omega_from, self.omega_to)


@dataclass(frozen=True)
class TuningSettings(Settings):
    """A search for gains and delays by the particle swarm.

    Every design found has all roots left of -`decay_rate` and stays stable while each delay moves by
    +- `delay_tolerance` (a fraction).
    """

    key: str = setting(not_empty=True, form=KEY)
    label: str = setting(not_empty=True)
    objective: str = setting(choices=tuple(_OBJECTIVES))
    weights: Mapping[str, float] = setting(not_empty=True, at_least=0.0)
    pairs: tuple[PairSettings, ...] = setting(not_empty=True)
    omega: float | None = setting(None, unit="rad_per_s", above=0.0)
    omega_from: float | None = setting(None, unit="rad_per_s", above=0.0)
    omega_to: float | None = setting(None, unit="rad_per_s", above=0.0)
    iso_class: str | None = setting(None, choices=ISO_CLASSES)
    particles: int = setting(60, at_least=2, at_most=100_000)
    iterations: int = setting(200, at_least=0, at_most=100_000)
    topology: str = setting("ring", choices=TOPOLOGIES)
    seed: int = setting(0, at_least=0)
    decay_rate: float = setting(0.0, unit="per_s", at_least=0.0)
    delay_tolerance: float = setting(0.0, at_least=0.0, at_most=0.99)
    compare: tuple[str, ...] = setting(())
    detuning: tuple[float, ...] = setting((0.95, 0.98, 0.99, 1.0, 1.01, 1.02, 1.05), above=0.0)

    def check(self) -> None:
        """Check that the objective has exactly the numbers it needs."""
        self.check_needs("objective", _OBJECTIVES)
        if self.omega_from is not None and self.omega_to is not None:
            check_band(self.omega_from, self.omega_to)
        if not any(self.weights.values()):
            raise SettingError("weights", dict(self.weights), "at least one weight greater than 0 is needed")


@dataclass(frozen=True)
class StabilitySettings(Settings):
    """Verdicts, roots, sweeps along lines of the delay plane, and the small-gain proof for a box of gains."""

    lines: tuple[str, ...] = setting(("equal", "ray", "tau2"))
    up_to: float = setting(2.0, unit="s", above=0.0)
    ray_up_to: float = setting(3.0, above=0.0)
    designs: tuple[str, ...] = setting(())
    roots: int = setting(8, at_least=1, at_most=200)
    box: tuple[BoxSettings, ...] = setting(())

    def check(self) -> None:
        """Check the names of the lines."""
        for n, line in enumerate(self.lines, 1):
            if line not in ("equal", "ray") and not re.fullmatch(r"tau[1-9]\d*", line):
                raise SettingError(f"lines[{n}]", line, nearest(line, ["equal", "ray", "tau1", "tau2"]))
            if line in self.lines[: n - 1]:
                raise SettingError(f"lines[{n}]", line, "it stands there twice")


@dataclass(frozen=True)
class StudySettings(Settings):
    """Everything that a study file says."""

    name: str = setting(not_empty=True)
    title: str = setting(not_empty=True)
    source: str = setting("", lines=True)
    description: str = setting("", lines=True)
    vehicle: VehicleSettings = setting(VehicleSettings())
    designs: tuple[DesignSettings, ...] = setting(())
    frequency: FrequencySettings | None = setting(None)
    tuning: tuple[TuningSettings, ...] = setting(())
    stability: StabilitySettings | None = setting(None)
    stability_maps: tuple[MapSettings, ...] = setting(())
    time: tuple[TimeSettings, ...] = setting(())
    pade: PadeSettings | None = setting(None)
    audit: AuditSettings | None = setting(None)
    sweep: SweepSettings | None = setting(None)
