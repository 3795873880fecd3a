"""The command line ``susp-ctrl``: arguments, progress, exit codes.

Exit status: 0 done, 1 the result could not be written, 2 bad input, 3 a stability verdict is undecided, 128 + n ended
by signal n (130 interrupted, 143 terminated). Nothing numerical is imported before a command runs, so that ``--help``
answers at once.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from susp_ctrl import __version__
from susp_ctrl.errors import InputError, one_line
from susp_ctrl.terminal import (
    UNDECIDED,
    Terminated,
    catch_signals,
    interrupted,
    one_line_errors,
    print_tables,
    progress_bar,
    say,
)

if TYPE_CHECKING:
    import pandas as pd

    from susp_ctrl.study import Study
    from susp_ctrl.study.results import StudyRun, TimeCase


app = typer.Typer(
    name="susp-ctrl",
    help="Linear systems under delayed feedback: exact responses, stability verdicts, tuning, ride reports.",
    epilog="Exit status: 0 done, 1 could not write, 2 bad input, 3 a stability verdict is undecided.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).", show_default=False)]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change a key of the study, as in vehicle.body_mass_kg=700."
    ),
]
Html = Annotated[bool, typer.Option("--html", help="Also write report.html, one page to open offline.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]


def main() -> None:
    """Run the command line."""
    # The matrices here are small: a second BLAS thread costs more than it brings, many times more on a busy machine.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    catch_signals()
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except Terminated as stopped:  # before a command began or after it ended
        sys.exit(stopped.status)
    except OSError as error:  # what is printed has no place to go
        say(error.strerror or error)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


@app.callback(invoke_without_command=True)
def _options(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        print(f"susp-ctrl {__version__}")
        raise typer.Exit()


@app.command(epilog="Example: susp-ctrl run studies/wu_ren_2020.toml --out reports/wu_ren_2020")
def run(
    study: StudyFile,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the report. [default: out/NAME-OF-THE-STUDY]", show_default=False),
    ] = None,
    html: Html = False,
    keep_results: Annotated[
        bool, typer.Option("--keep-results", help="Also store all numbers, for the command report.")
    ] = False,
    changes: Changes = None,
) -> None:
    """Run a whole study and write its report: PDF, CSV tables, figures."""
    with one_line_errors():
        import susp_ctrl as sc  # late: --help answers at once
        from susp_ctrl.report import check_folder  # late: --help answers at once

        settings = _load(study, changes)
        target = check_folder(Path("out") / study.stem if out is None else out)
        with progress_bar() as progress:
            result = sc.run_study(settings, progress=progress)
        try:
            with progress_bar() as progress:
                written = result.save(target, progress=progress, html=html, keep_results=keep_results)
        except OSError as error:
            raise OSError(f"{error}; {_kept_elsewhere(result.data)}") from None
        _tell(written, result.summary)
        _leave(result.data)


@app.command(epilog="Example: susp-ctrl report out/wu_ren_2020 --html")
def report(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a report with stored results.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Another folder for the report. [default: the same]", show_default=False),
    ] = None,
    html: Html = False,
) -> None:
    """Write a report again from the results that `run --keep-results` stored, without running the study.

    Only what a click on a map of the HTML page shows is computed then, as in any run with --html.
    """
    with one_line_errors():
        from susp_ctrl.report import StudyResult, check_folder  # late: --help answers at once
        from susp_ctrl.study.results import read_run  # late: --help answers at once

        result = StudyResult(read_run(folder))
        target = check_folder(folder if out is None else out)
        with progress_bar() as progress:
            written = result.save(target, progress=progress, html=html, keep_results=True)
        _tell(written, result.summary)


@app.command("list", epilog="Example: susp-ctrl list studies")
def list_studies(
    folder: Annotated[Path, typer.Argument(help="Folder with study files.")] = Path("studies"),
) -> None:
    """List the study files of a folder with their titles."""
    with one_line_errors():
        import susp_ctrl as sc  # late: --help answers at once

        if not folder.is_dir():
            raise InputError(f"folder = {str(folder)!r} is not allowed: there is no such folder")
        files = sorted(folder.glob("*.toml"))
        if not files:
            raise InputError(f"folder = {str(folder)!r} is not allowed: it holds no study file (*.toml)")
        width = max(len(str(path)) for path in files)
        for path in files:
            try:
                title = sc.load_study(path).settings.title
            except InputError as error:
                title = f"(not valid: {error})"
            print(f"{one_line(str(path)):<{width}}  {title}")


@app.command(epilog="Example: susp-ctrl new studies/my_car")
def new(
    name: Annotated[
        Path, typer.Argument(metavar="NAME", help="Name of the new study file.", show_default=False)
    ],
) -> None:
    """Write a commented template of a study file, to be edited."""
    with one_line_errors():
        from susp_ctrl.study.settings import new_study  # late: --help answers at once

        print(new_study(name))


@app.command(epilog="Example: susp-ctrl check studies/wu_ren_2020.toml")
def check(study: StudyFile) -> None:
    """Check a study file without running it."""
    with one_line_errors():
        import susp_ctrl as sc  # late: --help answers at once
        from susp_ctrl.study.audit import check_substitutions  # late: --help answers at once

        settings = sc.load_study(study)
        check_substitutions(settings)
        print(f"{one_line(str(study))}: valid. {settings.settings.title}")


@app.command(epilog="Example: susp-ctrl stability studies/wu_ren_2020.toml")
def stability(study: StudyFile, changes: Changes = None, as_json: AsJson = False) -> None:
    """Give a stability verdict on every design of a study, by three methods that must agree."""
    data = _compute(study, changes, "stability")
    assert data.stability is not None
    columns = ["design", "verdict", "abscissa", "unstable_roots", "delay_independent", "agreement"]
    print_tables(
        {"verdicts": data.stability.verdicts[columns], "rightmost roots": data.stability.roots}, as_json
    )
    _leave(data)


@app.command("sweep-delays", epilog="Example: susp-ctrl sweep-delays studies/wu_ren_2020.toml")
def sweep_delays(study: StudyFile, changes: Changes = None, as_json: AsJson = False) -> None:
    """Find all delays at which roots cross the imaginary axis, and the stable intervals between them."""
    import pandas as pd  # late: --help answers at once

    data = _compute(study, changes, "stability")
    assert data.stability is not None
    crossings, intervals = [], []
    for line in data.stability.lines:
        key = {"design": line.design, "line": line.line}
        crossings.append(line.sweep.crossings.assign(**key))
        margin = {"delay_margin": line.sweep.delay_margin, "proven": line.stable_for_every_delay}
        intervals.append(line.sweep.intervals.assign(**key, **margin))
    ordered = ["design", "line"]
    tables = {
        name: (table := pd.concat(parts, ignore_index=True))[
            [*ordered, *(c for c in table.columns if c not in ordered)]
        ]
        for name, parts in (("crossings", crossings), ("intervals", intervals))
        if parts
    }
    print_tables(tables, as_json)
    _leave(data)


@app.command(epilog="Example: susp-ctrl simulate studies/wu_ren_2020.toml --set 'time[random].road.seed=2'")
def simulate(study: StudyFile, changes: Changes = None, as_json: AsJson = False) -> None:
    """Simulate every design of a study on its roads: RMS values with exact delays, with Padé, and stationary.

    Designs that a search would find are left out: run the whole study for them.
    """
    data = _compute(study, changes, "time")
    print_tables(
        {case.key if as_json else case.road_text: _rms(case, as_json) for case in data.time}, as_json
    )


@app.command("compare-pade", epilog="Example: susp-ctrl compare-pade studies/wu_ren_2020.toml --json")
def compare_pade(study: StudyFile, changes: Changes = None, as_json: AsJson = False) -> None:
    """Show the error of Padé approximations of several orders against the exact delays."""
    data = _compute(study, changes, "pade")
    tables = {case.design: case.table for case in data.pade}
    for case in data.pade:
        extra = {"RMS": case.indicators, "order for a tolerance": case.met, "cost": case.cost}
        tables |= {f"{case.design}: {name}": t for name, t in extra.items() if t is not None}
    if data.pade_verdicts is not None:
        tables["verdicts"] = data.pade_verdicts
    print_tables(tables, as_json)
    _leave(data)


@app.command(epilog="Example: susp-ctrl tune studies/wu_ren_2020.toml --set 'tuning[random_tuned].seed=3'")
def tune(study: StudyFile, changes: Changes = None, as_json: AsJson = False) -> None:
    """Search gains and delays by particle swarm; only designs proven stable are returned."""
    data = _compute(study, changes, "tuning")
    tables: dict[str, pd.DataFrame] = {}
    for search in data.tuning:
        tables[f"{search.label}: {search.objective_text}"] = search.bounds
        tables[f"{search.label}: objective"] = search.comparison
    print_tables(tables, as_json)
    _leave(data)


@app.command(epilog="Example: susp-ctrl sweep studies/robustness.toml --workers 2 --set sweep.samples=100")
def sweep(
    study: StudyFile,
    workers: Annotated[
        int | None, typer.Option(help="Number of processes. [default: all processors]", show_default=False)
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the results. [default: out/NAME-OF-THE-STUDY_sweep]", show_default=False
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Compute on the Dask cluster of this scheduler.")
    ] = None,
    changes: Changes = None,
    as_json: AsJson = False,
) -> None:
    """Compute many variants of a study; every finished one is kept, and the same command goes on where it stopped."""
    with one_line_errors():
        import susp_ctrl as sc  # late: --help answers at once

        settings = _load(study, changes)
        folder = Path("out") / f"{study.stem}_sweep" if out is None else out
        with progress_bar() as progress:
            try:
                result = sc.sweep(
                    settings, workers=workers, folder=folder, scheduler=scheduler, progress=progress
                )
                progress("writing the results", 1.0)
                written = result.save(folder)
            except KeyboardInterrupt as stopped:
                raise interrupted(stopped, f"finished variants are kept in {folder}") from None
            except OSError as error:
                raise OSError(f"{error}; finished variants are kept in {folder}") from None
        if as_json:
            print_tables(result.tables, as_json)
        else:
            for path in written:
                print(path)
            print()
            print_tables({"yields": result.yields, "sensitivity of J": result.ranking("J")}, as_json)
            print(result)
        if result.undecided:
            say("the stability of at least one variant is undecided")
            raise typer.Exit(UNDECIDED)


def _load(path: Path, changes: list[str] | None) -> Study:
    import tomllib  # late: --help answers at once

    import susp_ctrl as sc  # late: --help answers at once

    values: dict[str, Any] = {}
    for change in changes or []:
        key, equals, text = change.partition("=")
        if not equals:
            raise InputError(f"--set {change}: KEY=VALUE is needed")
        try:
            values[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except (ValueError, RecursionError):
            values[key.strip()] = text.strip()  # a bare word is a string
    study = sc.load_study(path)
    return study.with_changes(values) if values else study


def _rms(case: TimeCase, as_records: bool) -> pd.DataFrame:
    """RMS values as they are, or with the designs side by side and a gap where there is no value."""
    if as_records:
        return case.rms
    index = ["indicator", "unit", "method"]
    active_first = case.rms.sort_values("role", key=lambda role: role == "passive", kind="stable")
    wide = active_first.pivot_table("value", index, "design", sort=False)[list(case.designs)]
    return wide.map("{:.6g}".format).replace("nan", "").reset_index()


def _compute(path: Path, changes: list[str] | None, section: str) -> StudyRun:
    with one_line_errors():
        from susp_ctrl.study import compute_study  # late: --help answers at once

        settings = _load(path, changes)
        with progress_bar() as progress:
            data = compute_study(settings, progress=progress, sections=(section,))
        if not getattr(data, section):
            raise InputError(f"{path}: the study has no section [{section}]")
        return data


def _tell(written: Iterable[Path], summary: Iterable[str]) -> None:
    for line in (*written, "", *summary):
        print(line)


def _leave(data: StudyRun) -> None:
    if data.undecided:
        say("the stability of at least one design is undecided")
        raise typer.Exit(UNDECIDED)


def _kept_elsewhere(data: StudyRun) -> str:
    """Store the results of a run whose report could not be written where it can be, and say where."""
    import tempfile  # late: --help answers at once

    from susp_ctrl.study.results import RESULTS, write_run  # late: --help answers at once

    try:
        folder = Path(tempfile.mkdtemp(prefix="susp_ctrl-"))
    except OSError:
        return "the results are lost"
    try:
        write_run(data, folder / RESULTS)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        return "the results are lost: there is no room for them either"
    return f"all results are kept: susp-ctrl report {folder} --out FOLDER writes the report"
