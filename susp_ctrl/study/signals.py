"""Units of plant signals, of feedback gains and of vehicle parameters."""

from __future__ import annotations

from susp_ctrl.errors import InputError

_KINDS = ("acceleration", "velocity", "displacement", "deflection", "force", "angle", "road")
_LINEAR = {
    "acceleration": "m/s2",
    "velocity": "m/s",
    "displacement": "m",
    "deflection": "m",
    "force": "N",
    "angle": "rad",
    "road": "m",
}
_ANGULAR = {"acceleration": "rad/s2", "velocity": "rad/s"}

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


def signal_unit(name: str) -> str:
    """Return the SI unit of a plant signal from its name, such as ``"rad/s2"`` for pitch_acceleration.

    Raises
    ------
    InputError
        A name that says nothing of its kind.
    """
    for kind in _KINDS:
        if kind in name.split("_"):
            angular = name.startswith(("pitch", "roll"))
            return _ANGULAR[kind] if angular and kind in _ANGULAR else _LINEAR[kind]
    raise InputError(f"signal {name!r} is of no known kind: its name must hold one of {', '.join(_KINDS)}")


def parameter_unit(name: str) -> str:
    """Return the unit of a vehicle parameter as a key suffix, such as ``"N_per_m"``."""
    for word, unit in _PARAMETER_UNITS:
        if word in name.split("_"):
            return unit
    return "m"


def readable(unit: str) -> str:
    """Return a unit of a key as text: ``N_s2_per_m`` is ``N s2/m``."""
    above, _, below = unit.partition("_per_")
    return above.replace("_", " ") + (f"/{below.replace('_', ' ')}" if below else "")


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
