"""Sweeps: one study in many variants, over all processors or a cluster, resumed where it was stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from susp_ctrl import __version__, validation
from susp_ctrl.errors import InputError
from susp_ctrl.study.settings import Study, SweepSettings, Tolerance, check_sweep, indicator_limits
from susp_ctrl.study.variants.dask_cluster import evaluate_on_cluster
from susp_ctrl.study.variants.evaluation import (
    Question,
    Row,
    answer,
    check_influence,
    failed_rows,
    lean_study,
)
from susp_ctrl.study.variants.journal import Journal, digest, probe
from susp_ctrl.study.variants.sampling_plan import (
    DrawnVariants,
    Grid,
    LatinHypercube,
    MonteCarlo,
    Plan,
    draw_variants,
)
from susp_ctrl.study.variants.sweep_result import SweepResult
from susp_ctrl.study.variants.sweep_summary import within_limits
from susp_ctrl.study.variants.worker_pool import evaluate_in_processes, usable_processors

Progress = Callable[[str, float], None]
Task = tuple[int, Mapping[str, Any]]
Answer = tuple[int, list[Row]]

_TEXTS = ("verdict", "note", "error")


def sweep(
    study: Study,
    grid_or_samples: Any = None,
    workers: int | Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]] | None = None,
    *,
    designs: Sequence[str] | None = None,
    time: str | None = None,
    weights: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    ray_up_to: float | None = None,
    retune: bool | None = None,
    folder: str | Path | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> SweepResult:
    r"""Compute many variants of a study: stability, delay margin, RMS values and J of every chosen design.

    .. math:: J = \sum_i n_i \sigma_i

    with the exact stationary RMS :math:`\sigma_i` of each output on the road.

    Parameters
    ----------
    study : Study
        From `load_study`.
    grid_or_samples : optional
        ``{key: values}`` for a full factorial grid, where values are a list, a `Range` or a `Tolerance` (relative
        change) and a tuple of keys moves together; `Grid`, `LatinHypercube` or `MonteCarlo`; or the samples themselves,
        as a list of ``{key: value}`` or a DataFrame whose columns are keys. Keys as in `Study.with_changes`. The
        section [sweep] of the study by default.
    workers : int or callable, optional
        Number of processes, all processors by default; each uses one BLAS thread. Or anything like `map`:
        ``workers(function, tasks)`` gives the answers in any order.
    designs : sequence of str, optional
        Keys of designs, ``"passive"`` for none; the given designs of the study by default. A design of [[tuning]] is
        searched once, on the study as it is, and then kept.
    time : str, optional
        Key of the [[time]] case whose road is met; by default the first random one, or else an ISO 8608 road of
        class C.
    weights : mapping of str to float, optional
        n_i by output; 0.7 body_acceleration and 0.3 pitch_acceleration by default.
    limits : mapping of str to float, optional
        What counts as good, by column: largest values, but least ones of ``delay_margin`` and ``delay_reserve``.
    ray_up_to : float, optional
        Multiple of the design's delays up to which a loss of stability is looked for; 3 by default.
    retune : bool, optional
        Search the designs of [[tuning]] again in every variant.
    folder : str or Path, optional
        Where to keep the journal: every finished variant is stored there at once, and the same sweep goes on from what
        it finds.
    scheduler : str, optional
        Address of a Dask scheduler that computes the variants instead; needs the extra ``cluster``.
    progress : callable, optional
        Called as ``progress(stage, fraction)``.

    Returns
    -------
    SweepResult
        ``.table`` with one row per variant and design, ``.percentiles``, ``.yields``, ``.sensitivity``,
        ``.heat_map()``, ``.plot()``, ``.save(folder)``. A variant that cannot be computed is a row with its ``error``.

    Raises
    ------
    InputError
        A key that does not exist or on which nothing depends, a design or case that does not exist, a journal of
        another sweep, a scheduler that does not answer.
    OSError
        The journal cannot be written, or all worker processes or the cluster are gone; what is stored stays.

    Notes
    -----
    The variants are drawn before anything is computed, and each is computed by itself from the study and its changes.
    So the table does not depend on the number of workers, on the order in which they finish, or on interruptions.

    Examples
    --------
    >>> import susp_ctrl as sc
    >>> study = sc.load_study("studies/wu_ren_2020.toml")
    >>> plan = sc.LatinHypercube({"vehicle.body_mass_kg": sc.Tolerance(0.1)}, samples=3, seed=1)
    >>> found = sc.sweep(study, plan, designs=["random_published"])
    >>> found.table["verdict"].tolist()
    ['stable', 'stable', 'stable']
    """
    if not isinstance(study, Study):
        raise InputError(f"study = {study!r} is not allowed: a Study of load_study is needed")
    settings = _settings(
        study,
        designs=tuple(designs) if designs is not None else None,
        time=time,
        weights=dict(weights) if weights is not None else None,
        limits=dict(limits) if limits is not None else None,
        ray_up_to=ray_up_to,
        retune=retune,
    )
    many = workers if callable(workers) else usable_processors()
    if workers is not None and not callable(workers):
        many = validation.integer("workers", workers, at_least=1, at_most=1024)
    report = progress or (lambda stage, fraction: None)
    report("drawing the variants", 0.0)
    plan = _plan(study) if grid_or_samples is None else grid_or_samples
    drawn = draw_variants(study, plan)
    question = Question.of(study, settings)
    check_influence(question, drawn.keys)
    target = None if folder is None else Path(folder)
    if target is not None:
        probe(target)  # before searches that may take long
    lean = lean_study(study, question)
    tasks: list[Task] = [(0, {}), *((n, dict(changes)) for n, changes in enumerate(drawn.changes, 1))]

    done: dict[int, list[Row]] = {}
    with nullcontext() if target is None else Journal(target, _identity(lean, question, drawn)) as journal:
        if journal is not None:
            columns = ["design", *question.columns]
            done = {
                n: [dict(zip(columns, row, strict=True)) for row in rows]
                for n, rows in journal.entries.items()
            }
        left = [task for task in tasks if task[0] not in done]
        lost: set[int] = set()
        for number, rows in _answers(lean, question, left, many, scheduler, lost):
            if journal is not None and number not in lost:
                journal.store(number, [list(row.values()) for row in rows])
            done[number] = rows
            report(f"{len(done)} of {len(tasks)} variants", len(done) / len(tasks))
    missing = [task[0] for task in tasks if task[0] not in done]
    if missing:
        raise InputError(f"workers gave no answer for {len(missing)} variants: anything like map is needed")
    return _result(study, settings, question, drawn, done, target)


def _settings(study: Study, **changes: Any) -> SweepSettings:
    """Return the section [sweep] of the study with what the caller says instead."""
    settings = study.settings.sweep or SweepSettings()
    settings = replace(settings, **{name: value for name, value in changes.items() if value is not None})
    check_sweep(settings, study.settings, study.plant.output_labels)
    return settings


def _plan(study: Study) -> Plan:
    """Return the plan of the section [sweep]."""
    settings = study.settings.sweep
    if settings is None:
        raise InputError(f"{study.file}: the study has no section [sweep], and no grid or samples are given")
    factors = [one.factor() for one in settings.factors]
    if settings.kind == "grid":
        return Grid(factors)
    kind = LatinHypercube if settings.kind == "latin_hypercube" else MonteCarlo
    given = {"samples": settings.samples, "seed": settings.seed}
    return kind(factors, **{name: value for name, value in given.items() if value is not None})


def _identity(lean: Study, question: Question, drawn: DrawnVariants) -> dict[str, str]:
    """Return what makes the numbers of a sweep what they are."""
    table = {section: entry for section, entry in lean.table.items() if section not in ("name", "title")}
    return {
        "the study": digest(table),
        "the variants": digest([dict(changes) for changes in drawn.changes]),
        "the designs, road, weights or range of delays": digest(asdict(question)),
        "the version of susp_ctrl": __version__,
        **{f"the version of {name}": version(name) for name in ("numpy", "scipy", "control")},
    }


def _answers(
    study: Study, question: Question, tasks: list[Task], workers: Any, scheduler: str | None, lost: set[int]
) -> Iterator[Answer]:
    """Yield the rows of every task as they are finished, in any order.

    The numbers of those whose processes died are added to `lost`: another run may have more luck with them.
    """
    if not tasks:
        return

    def give_up(task: Task, reason: str) -> Answer:
        lost.add(task[0])
        return task[0], failed_rows(question, reason)

    function = partial(answer, study, question)
    if scheduler is not None:
        yield from evaluate_on_cluster(function, tasks, scheduler, give_up)
    elif callable(workers):
        yield from workers(function, tasks)
    else:
        yield from evaluate_in_processes(function, tasks, min(workers, len(tasks)), give_up)


def _result(
    study: Study,
    settings: SweepSettings,
    question: Question,
    drawn: DrawnVariants,
    done: Mapping[int, list[Row]],
    folder: Path | None,
) -> SweepResult:
    limits = indicator_limits(settings.limits or {}, question.outputs)
    keys = drawn.keys
    own = {key: study.value(key) for key in keys}
    nominal = _table([0], [own], keys, question, done)
    table = _table(range(1, len(drawn.changes) + 1), drawn.changes, keys, question, done)
    for frame in (nominal, table):
        frame.insert(list(frame).index("note"), "within_limits", within_limits(frame, limits))
    return SweepResult(
        title=study.title,
        plan=drawn.kind,
        table=table,
        nominal=nominal,
        coordinates=drawn.coordinates,
        limits=limits,
        units=question.unit,
        outputs=question.outputs,
        random=drawn.random,
        relative=tuple(one.name for one in drawn.factors if isinstance(one.spread, Tolerance)),
        folder=folder,
    )


def _table(
    numbers: Iterable[int],
    changes: Sequence[Mapping[str, Any]],
    keys: list[str],
    question: Question,
    done: Mapping[int, list[Row]],
) -> pd.DataFrame:
    rows = [
        {"variant": number, "design": row["design"]}
        | {key: change.get(key) for key in keys}
        | {name: row[name] for name in question.columns}
        for number, change in zip(numbers, changes, strict=True)
        for row in done[number]
    ]
    table = pd.DataFrame(rows, columns=["variant", "design", *keys, *question.columns])
    table["verdict"] = table["verdict"].fillna("failed")
    table["unstable_roots"] = table["unstable_roots"].astype("Int64")
    for name in question.columns:
        if name not in (*_TEXTS, "unstable_roots"):
            table[name] = table[name].astype(float)
    return table
