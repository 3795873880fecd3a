"""Units of feedback gains and vehicle parameters as suffixes of keys, and the symbols of the source paper."""

from __future__ import annotations

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
