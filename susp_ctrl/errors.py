"""What can go wrong, by name: the exceptions and warnings of every room, and how their messages are written."""

from __future__ import annotations

from typing import Any

LONGEST_MESSAGE = 300
"""Characters of a message; what is longer loses its middle."""


def one_line(text: str, most: int = LONGEST_MESSAGE) -> str:
    r"""Return a text as one line that is safe on a terminal: nothing invisible, at most `most` characters.

    Line breaks, control characters and marks that turn the direction of writing stand as escapes.

    Examples
    --------
    >>> one_line("mass\x1b[2J = 3")
    'mass\\x1b[2J = 3'
    """
    # Far more than is shown, far less than a file: escaping costs time per character.
    text = _shortened(text.strip(), 4 * most)
    escaped = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return _shortened(escaped, most)


def shown(value: Any, most: int = 100) -> str:
    """Return a value as it stands in a message."""
    try:
        return one_line(repr(value), most)
    except Exception:  # an integer of thousands of digits, an object that cannot be shown
        return f"a {type(value).__name__} that cannot be shown"


def _shortened(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    kept = most - len("...")
    return f"{text[: kept - kept // 2]}...{text[len(text) - kept // 2 :]}"


class InputError(ValueError):
    """An argument is not what the function takes; the message, one line, names it, its value and what is allowed."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*(one_line(part) if isinstance(part, str) else part for part in args))


class NeutralLoopError(InputError):
    """A loop with delayed feed-through around it: a neutral system, for which nothing here is valid.

    The remedy is an actuator of finite bandwidth (``FeedbackChannel(..., actuator_bandwidth=...)``), which
    makes the loop retarded.
    """


class TooMuchWorkError(InputError):
    """A computation would take more work than is allowed; the message says how much, and what makes it less."""


class UnstableSystemError(InputError):
    """A quantity that exists only for stable systems was asked of one that is not shown to be stable."""


class UndecidedStabilityWarning(UserWarning):
    """The methods of a stability verdict differ, or a root lies on the axis as far as can be told."""


class PadeOrderWarning(UserWarning):
    """The Padé order is too low for the frequencies that matter; the message names the order needed."""
