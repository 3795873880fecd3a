"""A few processes of our own that evaluate tasks, each with one BLAS thread, so that the numbers are the same however
many there are.

They are started as new interpreters and not by `multiprocessing`: a script needs no ``if __name__ == "__main__"``, BLAS
reads its number of threads before it is loaded, and a worker whose parent was killed ends by itself.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Any

from susp_ctrl.study.variants.worker import READY

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment that holds every common BLAS to one thread."""

_ATTEMPTS = 2  # a task whose process dies twice is given up
_STARTS = 4  # processes in a row that die before their first task


class WorkerDiedError(RuntimeError):
    """A worker process ended in the middle of a task."""


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(len(os.sched_getaffinity(0)), 1)
    return os.cpu_count() or 1


def evaluate_in_processes(
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    workers: int,
    lost: Callable[[Any, str], Any],
) -> Iterator[Any]:
    """Yield the answers of ``function(task)`` in the order in which they are finished.

    Parameters
    ----------
    function : callable
        Picklable; must not raise.
    tasks : iterable
        Taken one by one, as processes are free.
    workers : int
        Number of processes.
    lost : callable
        ``lost(task, reason)`` is the answer for a task in which its process died twice.

    Raises
    ------
    OSError
        Several processes in a row could not be started.
    """
    program = pickle.dumps(function)
    answers: queue.Queue[Any] = queue.Queue(maxsize=4 * workers)
    supply, stop = _Supply(tasks), threading.Event()
    crews = [_Crew(program, supply, answers, lost, stop) for _ in range(workers)]
    try:
        for crew in crews:
            crew.start()
        busy = len(crews)
        while busy:
            answer = answers.get()
            if isinstance(answer, _Finished):
                busy -= 1
                if answer.problem is not None:
                    raise answer.problem
            else:
                yield answer
    finally:
        stop.set()
        for crew in crews:
            crew.kill()
        while any(crew.is_alive() for crew in crews):
            _drain(answers)
            for crew in crews:
                crew.join(0.01)


class _Finished:
    def __init__(self, problem: BaseException | None) -> None:
        self.problem = problem


class _Supply:
    """Tasks for several threads, one at a time."""

    def __init__(self, tasks: Iterable[Any]) -> None:
        self._tasks, self._lock = iter(tasks), threading.Lock()

    def __iter__(self) -> Iterator[Any]:
        while True:
            with self._lock:
                try:
                    task = next(self._tasks)
                except StopIteration:
                    return
            yield task


class _Crew(threading.Thread):
    """A thread that keeps one process at work."""

    def __init__(
        self,
        program: bytes,
        supply: _Supply,
        answers: queue.Queue[Any],
        lost: Callable[[Any, str], Any],
        stop: threading.Event,
    ) -> None:
        super().__init__(daemon=True, name="susp_ctrl worker")
        self._program, self._supply, self._answers, self._lost, self._stop_asked = (
            program, supply, answers, lost, stop,
        )  # fmt: skip
        self._process: subprocess.Popen[bytes] | None = None

    def run(self) -> None:
        """Answer tasks until there are none."""
        problem: BaseException | None = None
        try:
            for task in self._supply:
                answer = self._answer(task)
                if self._stop_asked.is_set():
                    break
                self._answers.put(answer)
        except BaseException as raised:  # told to the consumer, who raises it
            problem = raised
        finally:
            self.kill()
            self._answers.put(_Finished(problem))

    def _answer(self, task: Any) -> Any:
        reason = ""
        for _ in range(_ATTEMPTS):
            try:
                return self._ask(task)
            except WorkerDiedError as died:
                reason = str(died)
                if self._stop_asked.is_set():
                    break
        return self._lost(task, reason)

    def _ask(self, task: Any) -> Any:
        return self._exchange(self._process or self._start(), pickle.dumps(task))

    def _exchange(self, process: subprocess.Popen[bytes], sent: bytes) -> Any:
        """Send one pickle to the process and return what it answers."""
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(sent)
            process.stdin.flush()
            return pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            self.kill()
            raise WorkerDiedError(f"its process ended ({_ending(process)})") from None

    def _start(self) -> subprocess.Popen[bytes]:
        """Start a process; one that dies before it is ready is replaced, a few times."""
        reason = ""
        for _ in range(_STARTS):
            process = self._launch()
            try:
                if self._exchange(process, self._program) == READY:
                    return process
                reason = "it sent something else than its greeting"
            except WorkerDiedError as died:
                reason = str(died)
            self.kill()
            if self._stop_asked.is_set():
                break
        raise OSError(f"a worker process could not be started {_STARTS} times: {reason}")

    def _launch(self) -> subprocess.Popen[bytes]:
        path = os.pathsep.join(entry for entry in sys.path if entry)
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from susp_ctrl.study.variants.worker import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": path},
        )
        self._process = process
        if self._stop_asked.is_set():
            self.kill()
        return process

    def kill(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):  # unsent bytes for a process that is gone
                    pipe.close()


def _ending(process: subprocess.Popen[bytes]) -> str:
    code = process.wait()
    return f"signal {-code}" if code < 0 else f"exit status {code}"


def _drain(answers: queue.Queue[Any]) -> None:
    try:
        while True:
            answers.get_nowait()
    except queue.Empty:
        pass
