"""How the command line speaks: one line per mistake or signal, a progress bar, tables or JSON, exit statuses."""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

import typer

from susp_ctrl.errors import InputError, UndecidedStabilityWarning, one_line

if TYPE_CHECKING:
    import pandas as pd

WRITE_FAILED, BAD_INPUT, UNDECIDED, INTERRUPTED = 1, 2, 3, 130
_LONGEST_LINE = 1000

Progress = Callable[[str, float], None]


def catch_signals() -> None:
    """Let requests to end be met like an interrupt, with everything cleared up."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no hang-up
        if number is not None and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _terminate)


class Terminated(KeyboardInterrupt):
    """A signal asked the program to end: it clears up as after an interrupt."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number


def _terminate(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)  # a second one does not disturb the clearing up
    raise Terminated(number)


def interrupted(stopped: KeyboardInterrupt, kept: str) -> typer.Exit:
    """Say what ended the program and what is kept; return the exit."""
    ended = isinstance(stopped, Terminated)
    say(f"{'terminated' if ended else 'interrupted'}; {kept}")
    return typer.Exit(stopped.status if isinstance(stopped, Terminated) else INTERRUPTED)


def say(text: object, most: int = _LONGEST_LINE) -> None:
    """Print one line to the terminal, safe whatever the text holds."""
    print(f"susp-ctrl: {one_line(str(text), most)}", file=sys.stderr)


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn what a user can mend into one line and an exit status; show warnings as one line each."""
    with warnings.catch_warnings():
        warnings.simplefilter("once", UndecidedStabilityWarning)
        warnings.showwarning = lambda message, *_, **__: say(message)
        try:
            yield
        except InputError as error:
            say(error)
            raise typer.Exit(BAD_INPUT) from None
        except OSError as error:
            say(error)
            raise typer.Exit(WRITE_FAILED) from None
        except MemoryError:
            say("there is not enough memory for this")
            raise typer.Exit(WRITE_FAILED) from None
        except KeyboardInterrupt as stopped:
            raise interrupted(stopped, "nothing was written") from None


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show stages and the time left on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda stage, fraction: None
        return
    from rich.console import Console  # late: --help answers at once
    from rich.progress import (  # late: --help answers at once
        BarColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars  # late: --help answers at once

    columns = [
        TextColumn("{task.description:<32}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    ]
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("starting", total=1.0)
        yield lambda stage, fraction: bars.update(task, description=stage, completed=fraction)


def print_tables(tables: dict[str, pd.DataFrame], as_json: bool) -> None:
    """Print tables one below the other, or as JSON records."""
    if as_json:
        import json  # late: --help answers at once

        records: dict[str, Any] = {
            name: json.loads(table.to_json(orient="records", double_precision=15))
            for name, table in tables.items()
        }
        print(json.dumps(records, indent=1, ensure_ascii=False))
        return
    for name, table in tables.items():
        print(f"{name}\n{table.to_string(index=False, float_format=lambda v: f'{v:.6g}')}\n")
