"""The settings of a study: what a study file can say, with units, limits and defaults.

Defaults are those of the source paper where it gives them. A section that is not given is not run.
"""

# ruff: noqa: RUF009  setting() makes a dataclass field
from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from susp_ctrl.errors import InputError
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.audit_schema import AuditSettings
from susp_ctrl.study.settings import (
    MISSING,
    Place,
    SettingError,
    Settings,
    nearest,
    read_fields,
    setting,
)
from susp_ctrl.study.units import GAIN_UNITS, parameter_unit
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

VEHICLES: Mapping[str, type] = {"half_car": HalfCar, "quarter_car": QuarterCar, "full_car": FullCar}
OBJECTIVES = ("harmonic", "band_mean", "band_peak", "road_rms")
PAPER_INDICATORS = (
    "body_acceleration",
    "pitch_acceleration",
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
)
ISO_CLASSES = tuple("ABCDEFGH")
PASSIVE = "passive"

_KEY = re.compile(r"[a-z][a-z0-9_]*")


def _check_key(value: str) -> None:
    if not _KEY.fullmatch(value):
        raise SettingError("key", value, "a short name of small letters, digits and _ is needed")


def _check_increasing(lower_key: str, lower: float, upper_key: str, upper: float) -> None:
    if lower > upper:
        raise SettingError(upper_key, upper, f"at least {lower_key} = {lower:g} is needed")


def _check_band(lower: float, upper: float) -> None:
    if lower >= upper:
        raise SettingError(
            "omega_to_rad_per_s",
            upper,
            f"the band is empty: more than omega_from_rad_per_s = {lower:g} is needed",
        )


@dataclass(frozen=True)
class VehicleSettings(Settings):
    """A vehicle by its kind, with the parameters that differ from the defaults (Table 1 for the half car)."""

    kind: str = setting("half_car", choices=tuple(VEHICLES))
    speed: float = setting(20.0, unit="m_per_s", above=0.0)
    parameters: Mapping[str, float] = field(default_factory=dict, kw_only=True)

    def check(self) -> None:
        """Build the vehicle once, so that a bad parameter is found here."""
        self.build()

    @classmethod
    def from_table(cls, place: Place, table: Any) -> Self:
        """Read the kind, the speed and every parameter of that kind, ``<field>_<unit>``."""
        if not isinstance(table, Mapping):
            raise place.error(SettingError("", table, "a table is needed"))
        kind = table.get("kind", "half_car")
        if kind not in VEHICLES:
            raise place.error(SettingError("kind", kind, nearest(str(kind), list(VEHICLES))))
        names = {
            f"{f.name}_{parameter_unit(f.name)}": f.name for f in fields(VEHICLES[kind]) if f.name != "seat"
        }
        own = {"kind", "speed_m_per_s"}
        parameters = {}
        for given, value in table.items():
            if given in names:
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    raise place.error(SettingError(given, value, "a number is needed"))
                parameters[names[given]] = float(value)
            elif given not in own:
                allowed = nearest(given, [*own, *names])
                raise place.error(SettingError(given, value, f"unknown key, {allowed}"))
        try:
            return cls(kind=kind, speed=table.get("speed_m_per_s", 20.0), parameters=parameters)
        except SettingError as problem:
            in_file = next((g for g, name in names.items() if name == problem.key), problem.key)
            problem.key = in_file
            raise place.error(problem) from None

    def build(self) -> HalfCar | QuarterCar | FullCar:
        """Return the vehicle."""
        for name, value in self.parameters.items():
            try:
                VEHICLES[self.kind](**{name: value})
            except TypeError:
                allowed = nearest(name, [f.name for f in fields(VEHICLES[self.kind])])
                raise SettingError(name, value, f"unknown parameter, {allowed}") from None
            except InputError as problem:
                raise SettingError(name, value, str(problem).partition("is not allowed: ")[2]) from None
        car: HalfCar | QuarterCar | FullCar = VEHICLES[self.kind](**self.parameters)
        return car


@dataclass(frozen=True)
class _Feedback(Settings):
    """A measured signal and an actuator; the unit of gains follows from the signal."""

    measured: str = setting(not_empty=True)
    actuator: str = setting(not_empty=True)

    @classmethod
    def from_table(cls, place: Place, table: Any) -> Self:
        """Read the table; the keys of gains bear the unit that fits the measured signal."""
        if not isinstance(table, Mapping):
            raise place.error(SettingError("", table, "a table is needed"))
        measured = table.get("measured", MISSING)
        if not isinstance(measured, str):
            allowed = "this key is missing" if measured is MISSING else "the name of a plant output is needed"
            raise place.error(SettingError("measured", measured, allowed))
        try:
            unit = GAIN_UNITS[signal_unit(measured)]
        except InputError as problem:
            raise place.error(SettingError("measured", measured, str(problem))) from None
        gains = [f.name for f in fields(cls) if f.name.startswith("gain")]
        for name in gains:
            wrong = [k for k in table if k.startswith(f"{name}_N") and k != f"{name}_{unit}"]
            if wrong:
                allowed = f"{measured} is in {signal_unit(measured)}, so the key is {name}_{unit}"
                raise place.error(SettingError(wrong[0], table[wrong[0]], allowed))
        result: Self = read_fields(cls, place, table, dict.fromkeys(gains, unit))
        return result


@dataclass(frozen=True)
class ChannelSettings(_Feedback):
    """One feedback channel with a gain and a delay."""

    gain: float = setting()
    delay: float = setting(unit="s", at_least=0.0)
    actuator_bandwidth: float | None = setting(None, unit="rad_per_s", above=0.0)


@dataclass(frozen=True)
class PairSettings(_Feedback):
    """One channel whose gain and delay are searched, with their bounds."""

    gain_from: float = setting()
    gain_to: float = setting()
    delay_from: float = setting(0.001, unit="s", at_least=0.0)
    delay_to: float = setting(1.0, unit="s", at_least=0.0)

    def check(self) -> None:
        """Refuse lower bounds above upper ones."""
        _check_increasing("gain_from", self.gain_from, "gain_to", self.gain_to)
        _check_increasing("delay_from_s", self.delay_from, "delay_to_s", self.delay_to)


@dataclass(frozen=True)
class BoxSettings(_Feedback):
    """One channel of the box in which delay-independent stability is asked: gains up to this size."""

    gain: float = setting()


@dataclass(frozen=True)
class DesignSettings(Settings):
    """A given controller."""

    key: str = setting(not_empty=True)
    label: str = setting(not_empty=True)
    reference: str = setting("")
    channels: tuple[ChannelSettings, ...] = setting(not_empty=True)

    def check(self) -> None:
        """Check the key."""
        _check_key(self.key)
        if self.key == PASSIVE:
            raise SettingError("key", self.key, "this key is taken by the car without control")


@dataclass(frozen=True)
class FrequencySettings(Settings):
    """Frequency responses; |H| per road velocity of eq. (6) for `curve_designs` (all designs if empty)."""

    omega_from: float = setting(0.5, unit="rad_per_s", above=0.0)
    omega_to: float = setting(150.0, unit="rad_per_s", above=0.0)
    points: int = setting(1500, at_least=10, at_most=200_000)
    outputs: tuple[str, ...] = setting(PAPER_INDICATORS, not_empty=True)
    curve_outputs: tuple[str, ...] = setting(("body_acceleration", "pitch_acceleration"), not_empty=True)
    curve_designs: tuple[str, ...] = setting(())

    def check(self) -> None:
        """Refuse an empty band."""
        _check_band(self.omega_from, self.omega_to)


@dataclass(frozen=True)
class TuningSettings(Settings):
    """A search for gains and delays by the particle swarm."""

    key: str = setting(not_empty=True)
    label: str = setting(not_empty=True)
    objective: str = setting(choices=OBJECTIVES)
    weights: Mapping[str, float] = setting(not_empty=True, at_least=0.0)
    pairs: tuple[PairSettings, ...] = setting(not_empty=True)
    omega: float | None = setting(None, unit="rad_per_s", above=0.0)
    omega_from: float | None = setting(None, unit="rad_per_s", above=0.0)
    omega_to: float | None = setting(None, unit="rad_per_s", above=0.0)
    iso_class: str | None = setting(None, choices=ISO_CLASSES)
    particles: int = setting(60, at_least=2, at_most=100_000)
    iterations: int = setting(200, at_least=0, at_most=100_000)
    topology: str = setting("ring", choices=("ring", "global"))
    seed: int = setting(0, at_least=0)
    compare: tuple[str, ...] = setting(())
    detuning: tuple[float, ...] = setting((0.95, 0.98, 0.99, 1.0, 1.01, 1.02, 1.05), above=0.0)

    _NEEDS = {  # noqa: RUF012  a constant, no field
        "harmonic": ("omega",),
        "band_mean": ("omega_from", "omega_to"),
        "band_peak": ("omega_from", "omega_to"),
        "road_rms": ("iso_class",),
    }

    def check(self) -> None:
        """Check that the objective has exactly the numbers it needs."""
        _check_key(self.key)
        units = {
            "omega": "omega_rad_per_s",
            "omega_from": "omega_from_rad_per_s",
            "omega_to": "omega_to_rad_per_s",
        }
        for name in ("omega", "omega_from", "omega_to", "iso_class"):
            value, in_file = getattr(self, name), units.get(name, name)
            needed = name in self._NEEDS[self.objective]
            if needed and value is None:
                raise SettingError(
                    in_file, MISSING, f'this key is missing: objective = "{self.objective}" needs it'
                )
            if not needed and value is not None:
                raise SettingError(
                    in_file, value, f'not used with objective = "{self.objective}": remove this key'
                )
        if self.omega_from is not None and self.omega_to is not None:
            _check_band(self.omega_from, self.omega_to)
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


@dataclass(frozen=True)
class RoadSettings(Settings):
    """A road: harmonic, random (ISO 8608) or a bump."""

    kind: str = setting(choices=("harmonic", "random", "bump"))
    amplitude: float | None = setting(None, unit="m", at_least=0.0)
    omega: float | None = setting(None, unit="rad_per_s", above=0.0)
    iso_class: str | None = setting(None, choices=ISO_CLASSES)
    seed: int | None = setting(None, at_least=0)
    bins: int | None = setting(None, at_least=1, at_most=100_000)
    height: float | None = setting(None, unit="m")
    length: float | None = setting(None, unit="m", above=0.0)

    _NEEDS = {  # noqa: RUF012  a constant, no field
        "harmonic": ("amplitude_m", "omega_rad_per_s"),
        "random": ("iso_class", "seed"),
        "bump": ("height_m", "length_m"),
    }

    def check(self) -> None:
        """Check that the kind has exactly the numbers it needs."""
        values = {
            "amplitude_m": self.amplitude,
            "omega_rad_per_s": self.omega,
            "iso_class": self.iso_class,
            "seed": self.seed,
            "bins": self.bins,
            "height_m": self.height,
            "length_m": self.length,
        }
        needed = self._NEEDS[self.kind]
        optional = ("bins",) if self.kind == "random" else ()
        for name, value in values.items():
            if name in needed and value is None:
                raise SettingError(
                    name, MISSING, f'this key is missing: a road of kind = "{self.kind}" needs it'
                )
            if name not in (*needed, *optional) and value is not None:
                raise SettingError(name, value, f'not used with kind = "{self.kind}": remove this key')


@dataclass(frozen=True)
class TimeSettings(Settings):
    """A simulation on one road, passive car first.

    The record begins after `lead_in` seconds on the road. RMS values are taken at `step` after `skip`. The Padé
    order is `pade_order`, or else the one that the band up to `pade_omega` needs.
    """

    key: str = setting(not_empty=True)
    label: str = setting(not_empty=True)
    road: RoadSettings = setting()
    duration: float = setting(20.0, unit="s", above=0.0)
    step: float = setting(0.002, unit="s", above=0.0)
    report_step: float = setting(0.01, unit="s", above=0.0)
    lead_in: float = setting(0.0, unit="s", at_least=0.0)
    skip: float = setting(0.0, unit="s", at_least=0.0)
    designs: tuple[str, ...] = setting(())
    outputs: tuple[str, ...] = setting(PAPER_INDICATORS, not_empty=True)
    pade_order: int | None = setting(None, at_least=1, at_most=60)
    pade_omega: float = setting(100.0, unit="rad_per_s", above=0.0)

    def check(self) -> None:
        """Check the key and that the steps divide each other and the record."""
        _check_key(self.key)
        if self.step >= self.duration:
            raise SettingError("step_s", self.step, f"less than duration_s = {self.duration:g} is needed")
        if self.skip >= self.duration:
            raise SettingError("skip_s", self.skip, f"less than duration_s = {self.duration:g} is needed")
        ratio = self.report_step / self.step
        if ratio < 1 - 1e-9 or abs(ratio - round(ratio)) > 1e-6:
            raise SettingError(
                "report_step_s", self.report_step, f"a multiple of step_s = {self.step:g} is needed"
            )


@dataclass(frozen=True)
class PadeSettings(Settings):
    """Padé approximations of several orders against the exact delays."""

    orders: tuple[int, ...] = setting(not_empty=True, at_least=1, at_most=60)
    cases: Mapping[str, str] = setting(not_empty=True)
    omega_from: float = setting(0.5, unit="rad_per_s", above=0.0)
    omega_to: float = setting(100.0, unit="rad_per_s", above=0.0)
    points: int = setting(400, at_least=10, at_most=100_000)

    def check(self) -> None:
        """Refuse an empty band and orders that do not increase."""
        _check_band(self.omega_from, self.omega_to)
        if list(self.orders) != sorted(set(self.orders)):
            raise SettingError("orders", list(self.orders), "increasing orders are needed")


@dataclass(frozen=True)
class StudySettings(Settings):
    """Everything that a study file says."""

    name: str = setting(not_empty=True)
    title: str = setting(not_empty=True)
    source: str = setting("")
    description: str = setting("")
    vehicle: VehicleSettings = setting(VehicleSettings())
    designs: tuple[DesignSettings, ...] = setting(())
    frequency: FrequencySettings | None = setting(None)
    tuning: tuple[TuningSettings, ...] = setting(())
    stability: StabilitySettings | None = setting(None)
    time: tuple[TimeSettings, ...] = setting(())
    pade: PadeSettings | None = setting(None)
    audit: AuditSettings | None = setting(None)
