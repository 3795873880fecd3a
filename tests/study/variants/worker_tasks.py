"""Tasks for worker processes."""

from __future__ import annotations

import os
import signal


def ends_itself(task):
    """Die at task 3; else tell how many threads BLAS may use."""
    if task == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return task, os.environ["OPENBLAS_NUM_THREADS"]


def process_number(task):
    return os.getpid()
