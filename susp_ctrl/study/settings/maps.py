"""Settings of stability maps: which two numbers of a design are free, how far, and what a click shows."""

# ruff: noqa: RUF009  setting() makes a dataclass field
from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

from susp_ctrl.ride import signal_unit
from susp_ctrl.study.settings.fields import (
    MISSING,
    Place,
    SettingError,
    Settings,
    nearest,
    read_fields,
    setting,
)
from susp_ctrl.study.settings.simulation import RoadSettings
from susp_ctrl.study.settings.units import GAIN_UNITS
from susp_ctrl.study.settings.vehicle import check_key

AXES = ("tau1", "gain1", "tau2", "gain2")
"""What can be free, in the order in which x and y are taken from it."""

_MOST_INSTANTS = 2000  # of one response in the page
_GAIN_KEY = re.compile(r"(gain[12]_(?:from|to))_(\w+)")


@dataclass(frozen=True)
class ExplorerSettings(Settings):
    """What a click on the map of the HTML page shows: rightmost root and response, on a grid of points x points.

    The response is that of `output` (the first of the plant if empty) on `road`, from rest. It is only computed
    where a page is asked for.
    """

    points: int = setting(21, at_least=2, at_most=61)
    output: str = setting("")
    duration: float = setting(4.0, unit="s", above=0.0)
    step: float = setting(0.0125, unit="s", above=0.0)
    road: RoadSettings = setting(RoadSettings(kind="bump", height=0.05, length=1.0))

    def check(self) -> None:
        """Refuse a response of one instant, or of more than a page should hold."""
        if not self.step <= self.duration <= _MOST_INSTANTS * self.step:
            raise SettingError(
                "step_s",
                self.step,
                f"from {self.duration / _MOST_INSTANTS:g} (duration_s / {_MOST_INSTANTS}) to duration_s = "
                f"{self.duration:g} is needed",
            )


@dataclass(frozen=True)
class MapSettings(Settings):
    """A map of the number of unstable roots over two numbers of a design, all designs if none is named.

    Two of tau1, gain1, tau2, gain2 are free, each with its ``_from`` and ``_to``; both delays from 0 to 1 s if none
    is given. `channels` says which channels of the design are number one and two. All gains are `gain_factor`
    times those of the design, but for a gain that is free.
    """

    key: str = setting(not_empty=True)
    designs: tuple[str, ...] = setting(())
    gain_factor: float = setting(1.0, above=0.0)
    channels: tuple[int, int] = setting((1, 2), at_least=1)
    tau1_from: float | None = setting(None, unit="s", at_least=0.0)
    tau1_to: float | None = setting(None, unit="s", at_least=0.0)
    tau2_from: float | None = setting(None, unit="s", at_least=0.0)
    tau2_to: float | None = setting(None, unit="s", at_least=0.0)
    gain1_from: float | None = setting(None)
    gain1_to: float | None = setting(None)
    gain2_from: float | None = setting(None)
    gain2_to: float | None = setting(None)
    explorer: ExplorerSettings | None = setting(None)
    gain_units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    """Units that the file gives to the ends of free gains, by field."""

    @classmethod
    def from_table(cls, place: Place, table: Any) -> Self:
        """Read the table; keys of free gains bear a unit, such as ``gain1_to_N_per_m``."""
        given = [_GAIN_KEY.fullmatch(k) for k in table] if isinstance(table, Mapping) else []
        units = {m[1]: m[2] for m in given if m is not None and m[2] in GAIN_UNITS.values()}
        ends = [f"gain{n}_{end}" for n in (1, 2) for end in ("from", "to")]
        read: Self = read_fields(cls, place, table, {end: units.get(end, "N_per_m") for end in ends})
        return replace(read, gain_units=units)

    def check(self) -> None:
        """Check that two ranges are free, and that each is one."""
        check_key(self.key)
        for name in AXES:
            low, high = getattr(self, f"{name}_from"), getattr(self, f"{name}_to")
            if (low is None) != (high is None):
                missing = f"{name}_{'from' if low is None else 'to'}"
                raise SettingError(
                    missing, MISSING, "this key is missing: a range needs both its _from and its _to"
                )
            if low is not None and low >= high:
                raise SettingError(f"{name}_to", high, f"more than {name}_from = {low:g} is needed")
        if len(self.free) != 2:
            found = " and ".join(self.free)
            raise SettingError(f"{self.free[-1]}_to", found, "two of tau1, gain1, tau2, gain2 must be free")
        if self.channels[0] == self.channels[1]:
            raise SettingError("channels", list(self.channels), "two different numbers are needed")

    @property
    def free(self) -> tuple[str, ...]:
        """What is free: x, then y."""
        given = tuple(name for name in AXES if getattr(self, f"{name}_to") is not None)
        return given or ("tau1", "tau2")

    def range(self, name: str) -> tuple[float, float]:
        """Return the range of a free number."""
        low, high = getattr(self, f"{name}_from"), getattr(self, f"{name}_to")
        return (0.0, 1.0) if low is None else (low, high)

    def channel(self, name: str) -> int:
        """Return the position, from 0, of the design's channel that a free number belongs to."""
        return self.channels[int(name[-1]) - 1] - 1

    def fits(self, channels: int) -> bool:
        """Whether a design with this many channels has what is free."""
        return all(self.channel(name) < channels for name in self.free)


def check_maps(
    maps: Sequence[MapSettings], measured: Mapping[str, Sequence[str]], outputs: Sequence[str]
) -> None:
    """Check maps against the designs of a study.

    Parameters
    ----------
    maps : sequence of MapSettings
    measured : mapping of str to sequence of str
        What the channels of each design measure, by design.
    outputs : sequence of str
        Outputs of the plant.

    Raises
    ------
    SettingError
        An unknown or too small design, a gain of another unit, an unknown output, a key used twice.
    """
    keys = [entry.key for entry in maps]
    for entry in maps:
        place = f"stability_maps[{entry.key}]"
        if keys.count(entry.key) > 1:
            raise SettingError(f"{place}.key", entry.key, "every key may be used only once")
        for design in entry.designs:
            if design not in measured:
                allowed = nearest(design, list(measured)) if measured else "there is none in this study"
                raise SettingError(f"{place}.designs", design, allowed)
            if not entry.fits(len(measured[design])):
                needed = max(entry.channel(name) for name in entry.free) + 1
                count = len(measured[design])
                raise SettingError(
                    f"{place}.designs", design, f"a design with {needed} channels is needed, it has {count}"
                )
        chosen = list(entry.designs) or [key for key, names in measured.items() if entry.fits(len(names))]
        if not chosen:
            raise SettingError(f"{place}.designs", [], "no design of this study has these channels")
        for end, unit in entry.gain_units.items():
            for design in chosen:
                name = measured[design][entry.channel(end[:5])]
                right = GAIN_UNITS[signal_unit(name)]
                if unit != right:
                    raise SettingError(
                        f"{place}.{end}_{unit}",
                        getattr(entry, end),
                        f"the gain from {name} of {design} needs the key {end}_{right}",
                    )
        if entry.explorer is not None and entry.explorer.output and entry.explorer.output not in outputs:
            raise SettingError(
                f"{place}.explorer.output",
                entry.explorer.output,
                nearest(entry.explorer.output, list(outputs)),
            )
