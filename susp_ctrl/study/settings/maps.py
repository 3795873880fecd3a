"""Settings of stability maps: which two numbers of a design are free, how far, and what a click shows."""

# ruff: noqa: RUF009  setting() makes a dataclass field
from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from susp_ctrl.study.settings.fields import KEY, MISSING, Place, SettingError, Settings, setting
from susp_ctrl.study.settings.simulation import RoadSettings
from susp_ctrl.study.settings.vehicle import GAIN_UNITS

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
            least = f"{self.duration / _MOST_INSTANTS:g} (duration_s / {_MOST_INSTANTS})"
            allowed = f"from {least} to duration_s = {self.duration:g} is needed"
            raise SettingError("step_s", self.step, allowed)


@dataclass(frozen=True)
class MapSettings(Settings):
    """A map of the number of unstable roots over two numbers of a design, all designs if none is named.

    Two of tau1, gain1, tau2, gain2 are free, each with its ``_from`` and ``_to``; both delays from 0 to 1 s if none
    is given. `channels` says which channels of the design are number one and two. All gains are `gain_factor`
    times those of the design, but for a gain that is free.
    """

    key: str = setting(not_empty=True, form=KEY)
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
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read the table; keys of free gains bear a unit, such as ``gain1_to_N_per_m``."""
        given = [_GAIN_KEY.fullmatch(key) for key in table]
        units = {m[1]: m[2] for m in given if m is not None and m[2] in GAIN_UNITS.values()}
        ends = [f"gain{n}_{end}" for n in (1, 2) for end in ("from", "to")]
        settings = cls.read_fields(place, table, {end: units.get(end, "N_per_m") for end in ends})
        return replace(settings, gain_units=units)

    def check(self) -> None:
        """Check that two ranges are free, and that each is one."""
        for name in AXES:
            low, high = getattr(self, f"{name}_from"), getattr(self, f"{name}_to")
            if (low is None) != (high is None):
                allowed = "this key is missing: a range needs both its _from and its _to"
                raise SettingError(f"{name}_{'from' if low is None else 'to'}", MISSING, allowed)
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
