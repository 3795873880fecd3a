"""Settings of a sweep over many variants of a study: what varies, what is computed, and what counts as good."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any, Self

from susp_ctrl.errors import InputError
from susp_ctrl.ride import signal_unit
from susp_ctrl.ride.indicators import indicator_signals
from susp_ctrl.study.settings.fields import (
    MISSING,
    Place,
    SettingError,
    Settings,
    is_plain_text,
    nearest,
    setting,
)
from susp_ctrl.study.settings.variation import DISTRIBUTIONS, Factor, Levels, Range, Spread, Tolerance

MOST_VARIANTS = 1_000_000
KINDS = ("grid", "latin_hypercube", "monte_carlo")

LIMIT_SUFFIX = {"m": "m", "m/s2": "m_per_s2", "rad/s2": "rad_per_s2"}
"""Unit of an indicator as the end of a key."""

AT_LEAST = ("delay_margin", "delay_reserve")
"""Indicators of which more is better; of all others less is."""


@dataclass(frozen=True)
class FactorSettings(Settings):
    """One key, or several that move together, by a `relative` change, over a `range`, or through `values`."""

    keys: tuple[str, ...] = setting(not_empty=True)
    name: str = setting("")
    relative: tuple[float, float] | None = setting(None)
    range: tuple[float, float] | None = setting(None)
    levels: int = setting(3, at_least=2, at_most=10_000)
    distribution: str = setting("uniform", choices=DISTRIBUTIONS)
    values: tuple[Any, ...] = field(default=(), kw_only=True)

    def check(self) -> None:
        """Refuse what no `Factor` can be made of."""
        given = [name for name in ("relative", "range", "values") if getattr(self, name)]
        if len(given) != 1:
            found = " and ".join(given) if given else MISSING
            raise SettingError("relative", found, "one of relative, range and values is needed")
        try:
            self.factor()
        except InputError as problem:
            raise SettingError(given[0], getattr(self, given[0]), str(problem)) from None

    @classmethod
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read the table; `values` may be numbers or texts."""
        if "values" not in table:
            return cls.read_fields(place, table)
        values = table["values"]
        if not isinstance(values, list) or not values:
            raise place.error(SettingError("values", values, "a list of numbers or texts is needed"))
        for n, value in enumerate(values, 1):
            if isinstance(value, str) and not is_plain_text(value):
                allowed = "a text without line breaks, control or invisible characters is needed"
                raise place.error(SettingError(f"values[{n}]", value, allowed))
        rest = {name: value for name, value in table.items() if name != "values"}
        for name in ("relative", "range"):
            if name in rest:
                allowed = "not used beside values: remove one of them"
                raise place.error(SettingError(name, rest[name], allowed))
        # A range stands in for the values while the other keys are read.
        other = cls.read_fields(place, rest | {"range": [0.0, 1.0]})
        try:
            return cls(keys=other.keys, name=other.name, values=tuple(values))
        except SettingError as problem:
            raise place.error(problem) from None

    def factor(self) -> Factor:
        """Return the factor."""
        spread: Spread
        if self.values:
            spread = Levels(self.values)
        elif self.range is not None:
            spread = Range(*self.range, levels=self.levels, distribution=self.distribution)
        else:
            assert self.relative is not None
            spread = Tolerance(*self.relative, levels=self.levels, distribution=self.distribution)
        return Factor(self.keys, spread, self.name)


@dataclass(frozen=True)
class SweepSettings(Settings):
    """Many variants of the study.

    `designs` are those of the study that are no result of a search, by default; `time` is the case whose road is
    meant (the first random one); `weights` those of J. `limits` say what is good: ``body_acceleration_m_per_s2``,
    ``J``, ``abscissa_per_s`` are largest values, ``delay_margin`` and ``delay_reserve`` least ones.
    """

    kind: str = setting("latin_hypercube", choices=KINDS)
    factors: tuple[FactorSettings, ...] = setting(())
    samples: int | None = setting(None, at_least=1, at_most=MOST_VARIANTS)
    seed: int | None = setting(None, at_least=0)
    designs: tuple[str, ...] = setting(())
    time: str | None = setting(None)
    weights: Mapping[str, float] | None = setting(None, at_least=0.0)
    ray_up_to: float = setting(3.0, above=1.0, at_most=100.0)
    retune: bool = setting(False)
    limits: Mapping[str, float] | None = setting(None)

    @property
    def variants(self) -> int:
        """How many variants there are."""
        if self.kind == "grid":
            return prod(len(one.values) or one.levels for one in self.factors)
        return self.samples or 100

    @classmethod
    def read(cls, place: Place, table: Mapping[str, Any]) -> Self:
        """Read the table, in which something has to vary."""
        settings = cls.read_fields(place, table)
        if not settings.factors:
            raise place.error(SettingError("factors", MISSING, "at least one [[sweep.factors]] is needed"))
        return settings

    def check(self) -> None:
        """Check the factors together, and that a grid has no samples."""
        for name in ("samples", "seed"):
            if self.kind == "grid" and getattr(self, name) is not None:
                raise SettingError(name, getattr(self, name), 'not used with kind = "grid": remove this key')
        try:
            if self.factors:
                Factor.all_of([one.factor() for one in self.factors])
        except InputError as problem:
            raise SettingError("factors", [one.name for one in self.factors], str(problem)) from None
        if self.variants > MOST_VARIANTS:
            allowed = f"the grid has {self.variants:,} variants, at most {MOST_VARIANTS:,} are allowed"
            raise SettingError("factors", MISSING, allowed)


def indicator_limits(limits: Mapping[str, float], outputs: Sequence[str]) -> dict[str, float]:
    """Return limits by indicator from limits by key; a key is the indicator with its unit, or without.

    Raises
    ------
    SettingError
        An indicator that is not computed; the nearest one is named.
    """
    keys = {name: name for name in ("J", *AT_LEAST)} | {"abscissa_per_s": "abscissa"}
    for output in indicator_signals(outputs):
        keys[f"{output}_{LIMIT_SUFFIX[signal_unit(output)]}"] = output
    result = {}
    for key, value in limits.items():
        if key not in keys and key not in keys.values():
            raise SettingError(key, value, f"no such indicator, {nearest(key, keys)}")
        result[keys.get(key, key)] = float(value)
    return result
