r"""What the table of a sweep says: percentiles, yield, which factor matters, heat maps.

The share of a factor in the variance of an indicator y is the correlation ratio

.. math:: \eta^2 = \mathrm{Var}(\mathrm{E}[y \mid x]) / \mathrm{Var}(y),

the first-order sensitivity index of variance-based analysis, estimated from the means of y in groups of x and
corrected for what groups of chance would give (epsilon squared) where the variants are random; in a full grid all
groups hold the same values of the other factors and nothing is left to chance. It needs neither linearity nor
monotony; interactions of factors are what the shares leave of 1.

References
----------
.. [1] A. Saltelli et al., "Global Sensitivity Analysis. The Primer", Wiley, 2008.
.. [2] T. L. Kelley, "An unbiased correlation ratio measure", PNAS 21, 1935.
.. [3] E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22, 1927.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from susp_ctrl.arrays import FloatArray
from susp_ctrl.delay_systems import VERDICT_WORDS
from susp_ctrl.study.settings import AT_LEAST

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)
_GROUPS = 10
_LEAST_PER_GROUP = 8  # means of fewer are mostly chance
_LEAST_PER_CELL = 3
_WILSON = 1.959963984540054  # 95 %


@dataclass(frozen=True)
class HeatMap:
    """Mean of an indicator over two factors; the other factors vary within each cell.

    Attributes
    ----------
    design, indicator, x, y : str
        What is shown, over which factors.
    x_groups, y_groups : tuple of str
        Value, or range of values, of every column and row.
    values : ndarray, shape (rows, columns)
        Means; nan where no variant has a value.
    counts : ndarray of int, shape (rows, columns)
        Number of variants with a value.
    unit : str
        Of the indicator.
    """

    design: str
    indicator: str
    x: str
    y: str
    x_groups: tuple[str, ...]
    y_groups: tuple[str, ...]
    values: FloatArray
    counts: NDArray[np.int64]
    unit: str

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the map and return the axes."""
        from susp_ctrl.plotting import draw_heat_map  # loads matplotlib

        unit = f" ({self.unit})" if self.unit else ""
        return draw_heat_map(
            self.values, self.x_groups, self.y_groups, ax,
            xlabel=self.x, ylabel=self.y, label=f"{self.indicator}{unit}", title=self.design,
        )  # fmt: skip


def percentile_table(table: pd.DataFrame, nominal: pd.DataFrame, indicators: Sequence[str]) -> pd.DataFrame:
    """Return percentiles of every indicator of every design, over the variants that have a value.

    Returns
    -------
    DataFrame
        ``design, indicator, variants`` (that have a value), ``nominal``, ``mean, standard_deviation, least, p5, p25,
        p50, p75, p95, largest``. An infinite value (a delay margin proven for all delays) counts as such.
    """
    rows = []
    for design, part in table.groupby("design", sort=False):
        own = nominal[nominal["design"] == design]
        for name in indicators:
            values = np.sort(part[name].dropna().to_numpy(dtype=float))
            finite = values[np.isfinite(values)]
            whole = finite.size == values.size and values.size > 0
            row: dict[str, Any] = {"design": design, "indicator": name, "variants": values.size}
            row["nominal"] = float(own[name].iloc[0]) if len(own) and pd.notna(own[name].iloc[0]) else np.nan
            row["mean"] = float(finite.mean()) if whole else np.nan
            row["standard_deviation"] = float(finite.std(ddof=1)) if whole and finite.size > 1 else np.nan
            row["least"] = float(values[0]) if values.size else np.nan
            for percent in PERCENTILES:
                row[f"p{percent:g}"] = _percentile(values, percent)
            row["largest"] = float(values[-1]) if values.size else np.nan
            rows.append(row)
    return pd.DataFrame(rows)


def _percentile(ordered: FloatArray, percent: float) -> float:
    if ordered.size == 0:
        return float("nan")
    if np.all(np.isfinite(ordered)):
        return float(np.percentile(ordered, percent))
    return float(ordered[int(np.ceil(percent / 100.0 * ordered.size)) - 1 if percent else 0])


def within_limits(table: pd.DataFrame, limits: Mapping[str, float]) -> pd.Series:
    """Return for every row whether it is stable and within all limits; what has no value is not.

    A delay margin for which no end was found counts as the end of the search.
    """
    good = (table["verdict"] == "stable").to_numpy(dtype=bool, copy=True)
    for name, limit in limits.items():
        values = table[name].to_numpy(dtype=float)
        if name in AT_LEAST:
            searched = table["delay_searched_to"].to_numpy(dtype=float)
            with np.errstate(invalid="ignore"):
                good &= np.where(np.isnan(values), searched, values) >= limit
        else:
            with np.errstate(invalid="ignore"):
                good &= values <= limit
    return pd.Series(good, index=table.index)


def yield_table(table: pd.DataFrame, limits: Mapping[str, float]) -> pd.DataFrame:
    """Return how many variants of every design are good.

    Returns
    -------
    DataFrame
        ``design, variants, failed, stable, unstable, undecided, within_limits, yield`` (share of *all* variants that
        are stable and within limits), ``yield_from, yield_to`` (its 95 % interval by Wilson, for random samples) and
        ``broken_limits`` (how many stable variants break each limit).
    """
    rows = []
    for design, part in table.groupby("design", sort=False):
        total, good = len(part), int(part["within_limits"].sum())
        low, high = wilson_interval(good, total)
        stable = part[part["verdict"] == "stable"]
        broken = {name: int((~within_limits(stable, {name: limit})).sum()) for name, limit in limits.items()}
        verdicts: dict[str, int] = {w: int((part["verdict"] == w).sum()) for w in VERDICT_WORDS.values()}
        rows.append(
            {
                "design": design,
                "variants": total,
                "failed": int((part["error"] != "").sum()),
                **verdicts,
                "within_limits": good,
                "yield": good / total,
                "yield_from": low,
                "yield_to": high,
                "broken_limits": ", ".join(f"{name}: {number}" for name, number in broken.items() if number),
            }
        )
    return pd.DataFrame(rows)


def wilson_interval(good: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share, by Wilson's score."""
    share, spread = good / total, _WILSON**2 / total
    middle = (share + spread / 2.0) / (1.0 + spread)
    half = np.sqrt(spread * share * (1.0 - share) + spread**2 / 4.0) / (1.0 + spread)
    # at 0 and 1 the interval ends there exactly; rounding would miss it
    low = 0.0 if good == 0 else float(middle - half)
    high = 1.0 if good == total else float(middle + half)
    return low, high


def sensitivity_table(
    table: pd.DataFrame, coordinates: pd.DataFrame, indicators: Sequence[str], *, random: bool
) -> pd.DataFrame:
    """Rank the factors by their share in the variance of every indicator; `random` tells samples from a full grid.

    Returns
    -------
    DataFrame
        ``design, indicator, rank, factor, share`` (of the variance, 0 to 1; nan where too few variants have a value),
        ``spearman`` (rank correlation, its sign is the direction; nan for texts) and ``low_to_high`` (relative change
        of the mean from the lowest tenth, or lowest level, of the factor to the highest).
    """
    rows = []
    factors = {name: _numbers(coordinates[name]) for name in coordinates}
    # in a grid every level is a group
    most = _GROUPS if random else len(coordinates)
    groups = {name: _groups(coordinates[name], most, _LEAST_PER_GROUP)[0] for name in coordinates}
    for design, part in table.groupby("design", sort=False):
        places = part["variant"].to_numpy(dtype=int) - 1
        for indicator in indicators:
            y = part[indicator].to_numpy(dtype=float)
            valid = np.isfinite(y)
            if not np.any(valid):
                continue
            found = []
            for name in coordinates:
                x, group = factors[name], groups[name][places][valid]
                numeric = None if x is None else x[places][valid]
                share, change = _share(y[valid], group, random)
                found.append((name, share, _spearman(numeric, y[valid]), change))
            found.sort(key=lambda entry: -entry[1] if np.isfinite(entry[1]) else np.inf)
            rows += [(design, indicator, rank, *entry) for rank, entry in enumerate(found, 1)]
    columns = ["design", "indicator", "rank", "factor", "share", "spearman", "low_to_high"]
    return pd.DataFrame(rows, columns=columns)


def heat_map(
    table: pd.DataFrame,
    coordinates: pd.DataFrame,
    design: str,
    indicator: str,
    x: str,
    y: str,
    *,
    unit: str = "",
    relative: Collection[str] = (),
) -> HeatMap:
    """Return the mean of an indicator over two factors; those in `relative` are relative changes."""
    part = table[table["design"] == design]
    places = part["variant"].to_numpy(dtype=int) - 1
    values = part[indicator].to_numpy(dtype=float)
    valid = np.isfinite(values)
    cells = max(2, min(_GROUPS, int(np.sqrt(len(part) / _LEAST_PER_CELL))))
    columns, x_groups = _groups(coordinates[x], cells, percent=x in relative)
    rows, y_groups = _groups(coordinates[y], cells, percent=y in relative)
    shape = (len(y_groups), len(x_groups))
    sums, counts = np.zeros(shape), np.zeros(shape, dtype=np.int64)
    at = (rows[places][valid], columns[places][valid])
    np.add.at(sums, at, values[valid])
    np.add.at(counts, at, 1)
    means = np.divide(sums, counts, out=np.full(shape, np.nan), where=counts > 0)
    return HeatMap(design, indicator, x, y, x_groups, y_groups, means, counts, unit)


def _numbers(column: pd.Series) -> FloatArray | None:
    """Return a factor as numbers, None for texts."""
    if any(isinstance(value, str) for value in column):
        return None
    return column.to_numpy(dtype=float)


def _groups(
    column: pd.Series, most: int, least: int = 1, *, percent: bool = False
) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Sort the values of a factor into groups: its levels, or slices of equally many values."""
    levels = list(dict.fromkeys(column))
    numbers = _numbers(column)
    if numbers is None:
        levels = sorted(levels, key=str)
        names = tuple(str(level) for level in levels)
        return np.array([levels.index(value) for value in column], dtype=np.int64), names

    def written(value: float) -> str:
        return f"{100.0 * value:+.3g} %" if percent else f"{value:.4g}"

    ordered = np.unique(numbers)
    if ordered.size <= most:
        return np.searchsorted(ordered, numbers).astype(np.int64), tuple(map(written, ordered))
    number = max(2, min(most, numbers.size // least))
    edges = np.unique(np.quantile(numbers, np.linspace(0.0, 1.0, number + 1)))
    inside = np.searchsorted(edges[1:-1], numbers, side="right").astype(np.int64)
    return inside, tuple(f"{written(a)} to {written(b)}" for a, b in pairwise(edges))


def _share(y: FloatArray, group: NDArray[np.int64], random: bool) -> tuple[float, float]:
    """Return the correlation ratio, corrected for chance or not, and the relative change from first to last group."""
    present, place = np.unique(group, return_inverse=True)
    counts = np.bincount(place)
    means = np.bincount(place, weights=y) / counts
    change = float(means[-1] / means[0] - 1.0) if means[0] else np.nan
    total = float(np.sum((y - y.mean()) ** 2))
    freedom = y.size - present.size
    if total <= (1e-13 * np.abs(y).max()) ** 2 * y.size:
        return 0.0, 0.0  # the indicator does not vary
    within = float(np.sum((y - means[place]) ** 2))
    if not random:
        return max(0.0, 1.0 - within / total), change
    if freedom < 1:
        return np.nan, change
    return max(0.0, 1.0 - (within / freedom) / (total / (y.size - 1))), change


def _spearman(x: FloatArray | None, y: FloatArray) -> float:
    if x is None or y.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return float("nan")
    return float(pd.Series(x).rank().corr(pd.Series(y).rank()))
