"""What a sweep returns: one table of all variants, what it says in short, figures, and a folder of files."""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from susp_ctrl import validation
from susp_ctrl.csv_cells import write_csv
from susp_ctrl.delay_systems import VERDICT_WORDS
from susp_ctrl.errors import InputError
from susp_ctrl.study.settings import AT_LEAST
from susp_ctrl.study.variants.sweep_summary import (
    HeatMap,
    heat_map,
    percentile_table,
    sensitivity_table,
    yield_table,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_KINDS = ("sensitivity", "distribution", "heat_map")


@dataclass(frozen=True, eq=False)
class SweepResult:
    """All variants of a study.

    Attributes
    ----------
    title : str
        Of the study.
    plan : str
        How the variants were chosen.
    table : DataFrame
        One row per variant and design: ``variant`` (from 1), ``design``, every key that varies, then ``verdict``
        ("stable" | "unstable" | "undecided"), ``abscissa`` (1/s), ``unstable_roots``, ``delay_margin`` (multiple of the
        design's delays at which stability is first lost, from no delay on; inf: never), ``delay_reserve`` (the same
        from the design itself on; 0 if it is unstable), ``delay_searched_to`` (how far losses were looked for; where a
        margin is missing there is none up to here), the RMS values (SI, only of stable loops), ``J`` (their weighted
        sum), ``within_limits``, ``note`` (warnings), ``error`` (why there are no numbers; empty if there are).
    nominal : DataFrame
        The study itself, in the same columns.
    coordinates : DataFrame
        One row per variant, one column per factor.
    limits : mapping of str to float
        By column.
    units : mapping of str to str
        By column.
    outputs : tuple of str
        Columns that are RMS values.
    random : bool
        Whether the variants are samples, or else a full grid.
    relative : tuple of str
        Factors whose coordinates are relative changes.
    folder : Path or None
        Where the journal is.
    """

    title: str
    plan: str
    table: pd.DataFrame
    nominal: pd.DataFrame
    coordinates: pd.DataFrame
    limits: Mapping[str, float]
    units: Mapping[str, str]
    outputs: tuple[str, ...]
    random: bool
    relative: tuple[str, ...] = ()
    folder: Path | None = None

    @property
    def designs(self) -> list[str]:
        """Keys of the designs."""
        return list(dict.fromkeys(self.table["design"]))

    @property
    def factors(self) -> list[str]:
        """Names of the factors."""
        return [str(name) for name in self.coordinates.columns]

    @property
    def indicators(self) -> list[str]:
        """Columns that can be plotted and summed up."""
        return ["J", *self.outputs, "abscissa", *AT_LEAST]

    @cached_property
    def percentiles(self) -> pd.DataFrame:
        """Percentiles of every indicator of every design; see `percentile_table`."""
        return percentile_table(self.table, self.nominal, self.indicators)

    @cached_property
    def yields(self) -> pd.DataFrame:
        """How many variants are stable and within limits; see `yield_table`."""
        return yield_table(self.table, self.limits)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """Factors ranked by their share in the variance of every indicator; see `sensitivity_table`."""
        return sensitivity_table(self.table, self.coordinates, self.indicators, random=self.random)

    def ranking(self, indicator: str = "J") -> pd.DataFrame:
        """Return the factors ranked for one indicator, for every design."""
        name = validation.one_of("indicator", indicator, self.indicators)
        return self.sensitivity[self.sensitivity["indicator"] == name].reset_index(drop=True)

    @property
    def failed(self) -> pd.DataFrame:
        """Rows that have an error instead of numbers."""
        return self.table[self.table["error"] != ""]

    @property
    def undecided(self) -> bool:
        """Whether a verdict on any variant is open."""
        return bool((self.table["verdict"] == "undecided").any())

    def heat_map(
        self, x: str | None = None, y: str | None = None, indicator: str = "J", design: str | None = None
    ) -> HeatMap:
        """Return the mean of an indicator over two factors; the two that matter most by default.

        Raises
        ------
        InputError
            Fewer than two factors; an unknown factor, indicator or design.
        """
        names = self.factors
        if len(names) < 2:
            raise InputError(f"a heat map needs two factors, and this sweep has only {names[0]}")
        indicator = validation.one_of("indicator", indicator, self.indicators)
        chosen = self.designs[0] if design is None else validation.one_of("design", design, self.designs)
        ranked = self._ranked(indicator, chosen)
        first = validation.one_of("x", x if x is not None else next(n for n in ranked if n != y), names)
        others = [name for name in ranked if name != first]
        second = validation.one_of("y", y if y is not None else others[0], [n for n in names if n != first])
        return heat_map(
            self.table,
            self.coordinates,
            chosen,
            indicator,
            first,
            second,
            unit=self.units.get(indicator, ""),
            relative=self.relative,
        )

    def plot(
        self,
        kind: str = "sensitivity",
        ax: Axes | None = None,
        *,
        indicator: str = "J",
        design: str | None = None,
        x: str | None = None,
        y: str | None = None,
    ) -> Axes:
        """Draw the sweep and return the axes.

        Parameters
        ----------
        kind : {"sensitivity", "distribution", "heat_map"}
            Shares of the factors in the variance of the indicator; share of variants below a value, all designs or
            one; mean over two factors.
        ax : Axes, optional
            New ones by default.
        indicator : str
            Column of the table.
        design : str, optional
            The first one by default.
        x, y : str, optional
            Factors of the heat map.

        Raises
        ------
        InputError
            Something that does not exist; the nearest name is given.
        """
        from susp_ctrl.plotting import draw_distribution, draw_sensitivity  # loads matplotlib

        kind = validation.one_of("kind", kind, _KINDS)
        indicator = validation.one_of("indicator", indicator, self.indicators)
        chosen = None if design is None else validation.one_of("design", design, self.designs)
        if kind == "heat_map":
            return self.heat_map(x, y, indicator, chosen).plot(ax)
        unit = self.units.get(indicator, "")
        if kind == "distribution":
            shown = self.designs if chosen is None else [chosen]
            values = {key: self._values(self.table, key, indicator) for key in shown}
            own = {key: self._values(self.nominal, key, indicator) for key in shown}
            return draw_distribution(
                values, ax,
                nominal={key: float(one[0]) for key, one in own.items() if one.size},
                limit=self.limits.get(indicator),
                xlabel=f"{indicator} ({unit})" if unit else indicator,
            )  # fmt: skip
        chosen = chosen or self.designs[0]
        part = self._factors_of(indicator, chosen)
        return draw_sensitivity(
            dict(zip(part["factor"], part["share"], strict=True)),
            dict(zip(part["factor"], part["spearman"], strict=True)),
            ax,
            xlabel=f"share of the variance of {indicator}",
            title=chosen,
        )

    def _values(self, table: pd.DataFrame, design: str, indicator: str) -> np.ndarray:
        return table.loc[table["design"] == design, indicator].to_numpy(dtype=float)

    def _factors_of(self, indicator: str, design: str) -> pd.DataFrame:
        """Return the ranked factors for one indicator of one design; no row where no variant has a value."""
        return self.sensitivity.query("design == @design and indicator == @indicator")

    def _ranked(self, indicator: str, design: str) -> list[str]:
        return self._factors_of(indicator, design)["factor"].tolist() or self.factors

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Every table by name."""
        return {
            "variants": self.table,
            "nominal": self.nominal,
            "percentiles": self.percentiles,
            "yields": self.yields,
            "sensitivity": self.sensitivity,
        }

    def figures(self) -> dict[str, Figure]:
        """Draw the figures that `save` writes, by name."""
        from susp_ctrl.plotting import new_figure  # loads matplotlib

        drawn: dict[str, Figure] = {}

        def add(name: str, kind: str, height: float, design: str | None = None) -> None:
            figure, axes = new_figure(height=height)
            self.plot(kind, axes[0, 0], design=design)
            drawn[name] = figure

        add("distribution_J", "distribution", 2.9)
        for design in self.designs:
            if self._factors_of("J", design).empty:
                continue  # no variant of it is stable
            add(f"sensitivity_{design}", "sensitivity", 0.9 + 0.3 * len(self.factors), design)
            if len(self.factors) > 1:
                add(f"heat_map_{design}", "heat_map", 3.6, design)
        return drawn

    def save(self, folder: str | Path) -> list[Path]:
        """Write every table as CSV and every figure as PNG, each file whole or not at all.

        A text that a spreadsheet would take for a formula has an apostrophe before it.

        Parameters
        ----------
        folder : str or Path
            Made if it does not exist; files of the same names are replaced, others (the journal) kept.

        Returns
        -------
        list of Path

        Raises
        ------
        OSError
            The file system refuses; no file is half-written.
        """
        from susp_ctrl.plotting import save_figure  # loads matplotlib

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        written = []
        for name, table in self.tables.items():
            written.append(_whole(target / f"{name}.csv", partial(write_csv, table)))
        for name, figure in self.figures().items():
            written.append(_whole(target / f"{name}.png", partial(save_figure, figure)))
        return written

    def __str__(self) -> str:
        lines = [f"{self.title}: {self.plan}"]
        for row in self.yields.to_dict("records"):
            counts = ", ".join(f"{row[word]} {word}" for word in (*VERDICT_WORDS.values(), "failed"))
            lines.append(
                f"  {row['design']}: {row['within_limits']} of {row['variants']} variants "
                f"({100.0 * row['yield']:.1f} %) are stable and within limits; {counts}"
            )
            lines.append(f"    J depends most on {self._ranked('J', row['design'])[0]}")
        return "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """Show the summary in a notebook."""
        parts = [f"<h3>{html.escape(self.title)}</h3><p>{html.escape(self.plan)}</p>"]
        for name in ("yields", "percentiles", "sensitivity"):
            table = self.tables[name].to_html(index=False)
            parts.append(f"<details open><summary>{name}</summary>{table}</details>")
        return "\n".join(parts)


def _whole(path: Path, write: Callable[[Path], Any]) -> Path:
    """Write beside the target and rename."""
    beside = path.with_name(f".{path.stem}.partial-{os.getpid()}{path.suffix}")
    try:
        write(beside)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
    return path
