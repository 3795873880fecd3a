"""What can go wrong, by name: the exceptions and warnings of every room."""

from __future__ import annotations


class InputError(ValueError):
    """An argument is not what the function takes; the message names it, its value and what is allowed."""


class NeutralLoopError(InputError):
    """A loop with delayed feed-through around it: a neutral system, for which nothing here is valid.

    The remedy is an actuator of finite bandwidth (``FeedbackChannel(..., actuator_bandwidth=...)``), which
    makes the loop retarded.
    """


class UnstableSystemError(InputError):
    """A quantity that exists only for stable systems was asked of one that is not shown to be stable."""


class UndecidedStabilityWarning(UserWarning):
    """The methods of a stability verdict differ, or a root lies on the axis as far as can be told."""


class PadeOrderWarning(UserWarning):
    """The Padé order is too low for the frequencies that matter; the message names the order needed."""
