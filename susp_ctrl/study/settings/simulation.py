"""Settings of simulations: roads, records, and Padé approximations on them."""

# ruff: noqa: RUF009  setting() makes a dataclass field
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from susp_ctrl.road import ISO_8608_CLASSES
from susp_ctrl.study.settings.fields import KEY, MISSING, SettingError, Settings, setting

ISO_CLASSES = tuple(ISO_8608_CLASSES)

# What each kind of road needs to be told.
_ROADS = {"harmonic": ("amplitude", "omega"), "random": ("iso_class", "seed"), "bump": ("height", "length")}

_HIGHEST = 10.0  # m, of a bump or a wave
_MOST_SAMPLES = 2_000_000  # of a record: some hundred MB with all outputs


def check_band(lower: float, upper: float) -> None:
    """Refuse an empty band of frequencies (rad/s)."""
    if lower >= upper:
        allowed = f"the band is empty: more than omega_from_rad_per_s = {lower:g} is needed"
        raise SettingError("omega_to_rad_per_s", upper, allowed)


@dataclass(frozen=True)
class RoadSettings(Settings):
    """A road: harmonic, random (ISO 8608) or a bump."""

    kind: str = setting(choices=tuple(_ROADS))
    amplitude: float | None = setting(None, unit="m", above=0.0, at_most=_HIGHEST)
    omega: float | None = setting(None, unit="rad_per_s", above=0.0)
    iso_class: str | None = setting(None, choices=ISO_CLASSES)
    seed: int | None = setting(None, at_least=0)
    bins: int | None = setting(None, at_least=1, at_most=100_000)
    height: float | None = setting(None, unit="m", at_least=-_HIGHEST, at_most=_HIGHEST)
    length: float | None = setting(None, unit="m", above=0.0)

    def check(self) -> None:
        """Check that the kind has exactly the numbers it needs."""
        self.check_needs("kind", _ROADS, optional={"random": ("bins",)}, owner="a road of ")
        if self.height == 0.0:
            raise SettingError(
                "height_m", self.height, "a number other than 0 is needed: a flat road has no response"
            )


@dataclass(frozen=True)
class TimeSettings(Settings):
    """A simulation on one road, passive car first.

    The record begins after `lead_in` seconds on the road. RMS values are taken at `step` after `skip`. The outputs
    are the ride indicators of the vehicle by default. The Padé order is `pade_order`, or else the one that the band
    up to `pade_omega` needs.
    """

    key: str = setting(not_empty=True, form=KEY)
    label: str = setting(not_empty=True)
    road: RoadSettings = setting()
    duration: float = setting(20.0, unit="s", above=0.0)
    step: float = setting(0.002, unit="s", above=0.0)
    report_step: float = setting(0.01, unit="s", above=0.0)
    lead_in: float = setting(0.0, unit="s", at_least=0.0)
    skip: float = setting(0.0, unit="s", at_least=0.0)
    designs: tuple[str, ...] = setting(())
    outputs: tuple[str, ...] = setting(())
    pade_order: int | None = setting(None, at_least=1, at_most=60)
    pade_omega: float = setting(100.0, unit="rad_per_s", above=0.0)

    def check(self) -> None:
        """Check that the steps divide each other and the record."""
        if self.step >= self.duration:
            raise SettingError("step_s", self.step, f"less than duration_s = {self.duration:g} is needed")
        if self.skip >= self.duration:
            raise SettingError("skip_s", self.skip, f"less than duration_s = {self.duration:g} is needed")
        if self.duration / self.step > _MOST_SAMPLES:
            allowed = f"at most {_MOST_SAMPLES:,} steps: with this step_s, duration_s is {self.duration:g}"
            raise SettingError("step_s", self.step, allowed)
        ratio = self.report_step / self.step
        if ratio < 1 - 1e-9 or abs(ratio - round(ratio)) > 1e-6:
            allowed = f"a multiple of step_s = {self.step:g} is needed"
            raise SettingError("report_step_s", self.report_step, allowed)


@dataclass(frozen=True)
class PadeSettings(Settings):
    """Padé approximations of several orders against the exact delays.

    `cases` says on which road a design is compared. With a band of the wheel hop, the error there and that of the
    rightmost root in it are added; with `tolerances` (relative), the orders from which on each error keeps them.
    `by_indicator` adds the RMS error of each output; `cost_repeats` measures the time of each order, as the best of so
    many runs. The designs of `verdicts` are only asked whether Padé says the truth about their stability.
    """

    orders: tuple[int, ...] = setting(not_empty=True, at_least=1, at_most=60)
    cases: Mapping[str, str] = setting(not_empty=True)
    omega_from: float = setting(0.5, unit="rad_per_s", above=0.0)
    omega_to: float = setting(100.0, unit="rad_per_s", above=0.0)
    points: int = setting(400, at_least=10, at_most=100_000)
    wheel_hop_from: float | None = setting(None, unit="rad_per_s", above=0.0)
    wheel_hop_to: float | None = setting(None, unit="rad_per_s", above=0.0)
    tolerances: tuple[float, ...] = setting((), above=0.0)
    by_indicator: bool = setting(False)
    cost_repeats: int = setting(0, at_least=0, at_most=100)
    verdicts: tuple[str, ...] = setting(())

    def check(self) -> None:
        """Refuse empty bands, half a band of the wheel hop, and orders that do not increase."""
        check_band(self.omega_from, self.omega_to)
        low, high = self.wheel_hop_from, self.wheel_hop_to
        for name, value, other in (("wheel_hop_from", low, high), ("wheel_hop_to", high, low)):
            if value is None and other is not None:
                raise SettingError(f"{name}_rad_per_s", MISSING, "this key is missing: a band has two ends")
        if low is not None and high is not None and low >= high:
            allowed = f"more than wheel_hop_from_rad_per_s = {low:g} is needed"
            raise SettingError("wheel_hop_to_rad_per_s", high, allowed)
        if list(self.orders) != sorted(set(self.orders)):
            raise SettingError("orders", list(self.orders), "increasing orders are needed")

    @property
    def wheel_hop(self) -> tuple[float, float] | None:
        """The band of the wheel hop (rad/s), if there is one."""
        if self.wheel_hop_from is None or self.wheel_hop_to is None:
            return None
        return self.wheel_hop_from, self.wheel_hop_to
