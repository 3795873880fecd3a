"""The other end of `worker_pool`: a process that answers tasks until its standard input ends."""

from __future__ import annotations

import os
import pickle
import signal
import sys

READY = "ready"


def serve() -> None:
    """Read a function, then tasks; write an answer to each.

    The process ends with its parent, however that ended: then its standard input ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt means
    tasks = sys.stdin.buffer
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever prints does not disturb the answers
    try:
        function = pickle.load(tasks)
        pickle.dump(READY, answers)
        answers.flush()
        while True:
            answer = function(pickle.load(tasks))
            pickle.dump(answer, answers)
            answers.flush()
    except (EOFError, BrokenPipeError):
        # Nobody is left to answer. The interpreter would complain about unwritten bytes: leave at once.
        os._exit(0)
