"""`StudyResult`: a finished study as tables, figures and a folder of files; `run_study` makes one."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure as MatplotlibFigure

from susp_ctrl import plotting
from susp_ctrl import study as studies
from susp_ctrl.csv_cells import write_csv
from susp_ctrl.report.blocks import Figure, Section, Table
from susp_ctrl.report.document import NO_TYPST, payload, write_pdf
from susp_ctrl.report.page import table_html, write_page
from susp_ctrl.report.saving import MANIFEST, replacing, write_manifest
from susp_ctrl.report.sections import sections_of
from susp_ctrl.report.sections.provenance import all_versions
from susp_ctrl.study import Study
from susp_ctrl.study.results import RESULTS, MapExplorer, StudyRun, write_run
from susp_ctrl.study.sections import map_explorers

Progress = Callable[[str, float], None]


class FigureGallery(Mapping[str, "MatplotlibFigure"]):
    """Figures by name, each drawn when it is first asked for."""

    def __init__(self, figures: tuple[Figure, ...]) -> None:
        self._specifications = {figure.key: figure for figure in figures}
        self._drawn: dict[str, MatplotlibFigure] = {}

    def __getitem__(self, name: str) -> MatplotlibFigure:
        if name not in self._drawn:
            self._drawn[name] = self._specifications[name].draw()
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._specifications)

    def __len__(self) -> int:
        return len(self._specifications)

    def __contains__(self, name: object) -> bool:
        return name in self._specifications  # without drawing it, as the base class would

    def __repr__(self) -> str:
        return f"FigureGallery({', '.join(self._specifications)})"

    def caption(self, name: str) -> str:
        """Return what a figure shows."""
        return self._specifications[name].caption


class StudyResult:
    """What a study gives: data, tables, figures, and a report that can be saved.

    Parameters
    ----------
    data : StudyRun
        What the study computed.

    Attributes
    ----------
    data : StudyRun
        All numbers, in SI units.
    sections : tuple of Section
        The report as content: text, equations, tables, figures.
    tables : dict of str to DataFrame
        Every table of the report, in SI units and full precision.
    figures : mapping of str to matplotlib Figure
        Every figure of the report, drawn when it is first asked for.
    summary : tuple of str
        The three lines a person most wants to know.
    """

    def __init__(self, data: StudyRun) -> None:
        self.data = data
        self._computed_explorers: list[MapExplorer] = []

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """The chapters of the report."""
        return sections_of(self.data)

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Every table by name."""
        return {table.key: table.frame for table in self._tables}

    @cached_property
    def figures(self) -> FigureGallery:
        """Every figure by name, drawn on demand."""
        return FigureGallery(self._figures)

    @property
    def summary(self) -> tuple[str, ...]:
        """The three lines a person most wants to know."""
        return self.data.headlines

    def save(
        self,
        folder: str | Path,
        *,
        progress: Progress | None = None,
        history_digits: int = 5,
        html: bool = False,
        keep_results: bool = False,
    ) -> list[Path]:
        """Write the report: ``report.pdf``, ``tables/*.csv``, ``figures/*.png`` and ``*.pdf``, ``manifest.json``.

        The folder is replaced as a whole or not at all, see `susp_ctrl.report.replacing`. In the CSV files a text
        that a spreadsheet would take for a formula has an apostrophe before it.

        Parameters
        ----------
        folder
            Where to: a new folder, an empty one, or that of an earlier report.
        progress
            Called with (what is being written, fraction done).
        history_digits
            Significant digits of the time histories, by far the largest files; 17 keeps every bit. All other
            tables are written in full precision.
        html
            Also write ``report.html``: the same content as one page that opens offline, with plots to zoom, and
            maps to click on where the study asks for them (some more seconds to compute).
        keep_results
            Also write ``results.npz``: every number of the run, from which the report can be written again.

        Returns
        -------
        list of Path
            The files written.

        Raises
        ------
        InputError
            The folder is a file, the current folder, or holds other things than a report.
        SaveError
            The file system refuses (read-only, disk full); nothing was changed.
        """
        report = progress or (lambda stage, fraction: None)
        target = Path(folder)
        with replacing(target) as partial:
            self._write_tables(partial / "tables", history_digits)
            self._write_figures(partial / "figures", report)
            report("setting the document", 0.9)
            if write_pdf(partial, payload(self.data, self.sections)) is None:
                warnings.warn(NO_TYPST, stacklevel=2)
            if html:
                explorers = self._explorers(report)
                report("writing the page", 0.97)
                write_page(partial, self.data, self.sections, explorers=explorers)
            if keep_results:
                write_run(self.data, partial / RESULTS)
            write_manifest(partial, self._about())
            written = sorted(path.relative_to(partial) for path in partial.rglob("*") if path.is_file())
        report("done", 1.0)
        return [target / path for path in written]

    @property
    def _tables(self) -> tuple[Table, ...]:
        return tuple(table for section in self.sections for table in section.tables)

    @property
    def _figures(self) -> tuple[Figure, ...]:
        return tuple(figure for section in self.sections for figure in section.figures)

    def _explorers(self, report: Progress) -> list[MapExplorer]:
        """Return the maps to click on; only the page needs them, so only then they are computed."""

        def told(share: float) -> None:
            report("points of the stability map", 0.92 + 0.05 * share)

        if not self._computed_explorers:
            self._computed_explorers = list(map_explorers(self.data, told).values())
        return self._computed_explorers

    def _write_tables(self, folder: Path, history_digits: int) -> None:
        folder.mkdir()
        for table in self._tables:
            digits = f"%.{history_digits}g" if table.key.startswith("history_") else None
            write_csv(table.frame, folder / f"{table.key}.csv", float_format=digits)

    def _write_figures(self, folder: Path, report: Progress) -> None:
        folder.mkdir()
        for number, figure in enumerate(self._figures):
            report(f"drawing {figure.key.replace('_', ' ')}", 0.9 * number / len(self._figures))
            drawn = figure.draw()
            plotting.save_figure(drawn, folder / f"{figure.key}.png")
            drawn.set_layout_engine("none")  # the layout stands; a second pass would only cost time
            plotting.save_figure(drawn, folder / f"{figure.key}.pdf")

    def _about(self) -> dict[str, Any]:
        source = self.data.provenance
        return {
            "title": self.data.study.title,
            "study_file": source.study_file,
            "study_sha256": source.study_sha256,
            "versions": all_versions(self.data),
            "seeds": dict(source.seeds),
            "summary": list(self.summary),
            "undecided": self.data.undecided,
        }

    def __repr__(self) -> str:
        lines = [f"StudyResult: {self.data.study.title}", *(f"  {line}" for line in self.summary)]
        lines.append(f"  tables: {', '.join(self.tables)}")
        lines.append(f"  figures: {', '.join(self.figures)}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Show title, summary and the tables of the document, as a notebook asks for it."""
        parts = [f"<h3>{escape(self.data.study.title)}</h3>"]
        parts += [f"<p>{escape(line)}</p>" for line in self.summary]
        for table in self._tables:
            if table.in_document and table.columns:
                parts.append(
                    f"<details><summary>{escape(table.caption)}</summary>{table_html(table)}</details>"
                )
        names = ", ".join(f"<code>{escape(name)}</code>" for name in self.figures)
        parts.append(f"<p>Figures, drawn on demand by <code>.figures[name]</code>: {names}</p>")
        return "\n".join(parts)


def run_study(study: Study, progress: Progress | None = None) -> StudyResult:
    """Compute a study and return its result: tables, figures, and a report that can be saved.

    Parameters
    ----------
    study : Study
        Of `susp_ctrl.load_study`.
    progress : callable, optional
        Called with (stage in words, fraction done) while it runs.

    Returns
    -------
    StudyResult

    Raises
    ------
    InputError
        The study cannot be run as it is.

    Examples
    --------
    >>> import susp_ctrl as sc
    >>> result = sc.run_study(sc.load_study("studies/quarter_car_bump.toml"))
    >>> result.tables["stability"][["design", "verdict"]].to_dict("list")
    {'design': ['passive', 'prompt', 'slow'], 'verdict': ['stable', 'stable', 'stable']}
    >>> "rms_bump" in result.tables, "pade_error" in result.figures
    (True, True)

    ``result.save("out/bump")`` writes the report.
    """
    return StudyResult(studies.compute_study(study, progress=progress))


__all__ = ["MANIFEST", "FigureGallery", "StudyResult", "run_study"]
