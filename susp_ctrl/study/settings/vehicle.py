"""Settings of the vehicle and of its controllers: what is measured, what acts, with which gain and delay.

The units of feedback gains and of vehicle parameters stand here as they end the keys of a study file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Self

from susp_ctrl.delay_systems import FeedbackChannel
from susp_ctrl.errors import InputError
from susp_ctrl.ride import signal_unit
from susp_ctrl.study.settings.fields import (
    KEY,
    MISSING,
    Place,
    SettingError,
    Settings,
    check_size,
    nearest,
    setting,
)
from susp_ctrl.vehicle import FullCar, HalfCar, QuarterCar

VEHICLES: Mapping[str, type] = {"half_car": HalfCar, "quarter_car": QuarterCar, "full_car": FullCar}
PASSIVE = "passive"

GAIN_UNITS = {
    "m": "N_per_m",
    "m/s": "N_s_per_m",
    "m/s2": "N_s2_per_m",
    "rad": "N_per_rad",
    "rad/s": "N_s_per_rad",
    "rad/s2": "N_s2_per_rad",
    "N": "N_per_N",
}
"""Unit of a gain to a force, as a key suffix, by the unit of the measured signal."""

_PARAMETER_UNITS = (("mass", "kg"), ("inertia", "kg_m2"), ("stiffness", "N_per_m"), ("damping", "N_s_per_m"))


def parameter_unit(name: str) -> str:
    """Return the unit of a vehicle parameter as a key suffix, such as ``"N_per_m"``."""
    for word, unit in _PARAMETER_UNITS:
        if word in name.split("_"):
            return unit
    return "m"


def parameter_keys(vehicle: type) -> dict[str, str]:
    """Return the fields of a vehicle by their keys in a study file; a seat is no number and has none."""
    return {f"{f.name}_{parameter_unit(f.name)}": f.name for f in fields(vehicle) if f.name != "seat"}


def readable(unit: str) -> str:
    """Return a unit of a key as text: ``N_s2_per_m`` is ``N s2/m``."""
    above, _, below = unit.partition("_per_")
    return above.replace("_", " ") + (f"/{below.replace('_', ' ')}" if below else "")


def gain_unit(measured: str) -> str:
    """Return the unit of a gain from a measured signal to a force as text, such as ``N s/m``."""
    return readable(GAIN_UNITS[signal_unit(measured)])


PAPER_SYMBOLS = {
    "body_mass": "m",
    "pitch_inertia": "I",
    "unsprung_mass_front": "mtf",
    "unsprung_mass_rear": "mtr",
    "tire_stiffness_front": "ktf",
    "tire_stiffness_rear": "ktr",
    "spring_stiffness_front": "ksf",
    "spring_stiffness_rear": "ksr",
    "damping_front": "csf",
    "damping_rear": "csr",
    "axle_distance_front": "Lf",
    "axle_distance_rear": "Lr",
}
"""Symbols of Table 1 of the source paper by field of `HalfCar`."""


def _check_increasing(lower_key: str, lower: float, upper_key: str, upper: float) -> None:
    if lower > upper:
        raise SettingError(upper_key, upper, f"at least {lower_key} = {lower:g} is needed")


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
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read the kind, the speed and every parameter of that kind, ``<field>_<unit>``."""
        kind = table.get("kind", "half_car")
        if kind not in list(VEHICLES):
            raise place.error(SettingError("kind", kind, nearest(str(kind), VEHICLES)))
        names = parameter_keys(VEHICLES[kind])
        own = ("kind", "speed_m_per_s")
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
            problem.key = next((g for g, name in names.items() if name == problem.key), problem.key)
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
            check_size(name, value, parameter_unit(name))
        car: HalfCar | QuarterCar | FullCar = VEHICLES[self.kind](**self.parameters)
        return car


@dataclass(frozen=True)
class _Feedback(Settings):
    """A measured signal and an actuator; the unit of gains follows from the signal."""

    measured: str = setting(not_empty=True)
    actuator: str = setting(not_empty=True)

    @classmethod
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read the table; the keys of gains bear the unit that fits the measured signal."""
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
        return cls.read_fields(place, table, dict.fromkeys(gains, unit))


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
    actuator_bandwidth: float | None = setting(None, unit="rad_per_s", above=0.0)

    @property
    def widest(self) -> FeedbackChannel:
        """The channel at the corner of the bounds."""
        gain = max(self.gain_from, self.gain_to, key=abs)
        return FeedbackChannel(self.measured, self.actuator, gain, self.delay_to, self.actuator_bandwidth)

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

    key: str = setting(not_empty=True, form=KEY)
    label: str = setting(not_empty=True)
    reference: str = setting("", lines=True)
    channels: tuple[ChannelSettings, ...] = setting(not_empty=True)

    def check(self) -> None:
        """Check the key."""
        if self.key == PASSIVE:
            raise SettingError("key", self.key, "this key is taken by the car without control")


def feedback_channels(channels: Iterable[ChannelSettings]) -> tuple[FeedbackChannel, ...]:
    """Return the channels of a design as the delay systems take them."""
    return tuple(
        FeedbackChannel(c.measured, c.actuator, c.gain, c.delay, c.actuator_bandwidth) for c in channels
    )
