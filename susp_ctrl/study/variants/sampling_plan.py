"""Which variants a sweep computes: full factorial grids, Latin hypercube, Monte Carlo, or given samples.

All values are drawn before anything is computed, from one seed, so they do not depend on who computes what.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from susp_ctrl import validation
from susp_ctrl.arrays import FloatArray
from susp_ctrl.errors import InputError
from susp_ctrl.study.settings import MOST_VARIANTS, Factor, Levels, Study, Tolerance, Value, plain_value

_TRIALS = 50  # values of a key that are tried until the study takes one


@dataclass(frozen=True)
class DrawnVariants:
    """The variants of a sweep.

    Attributes
    ----------
    kind : str
        How they were chosen, in words.
    factors : tuple of Factor
    coordinates : DataFrame
        One row per variant, one column per factor: the value, or the relative change of a `Tolerance`.
    changes : tuple of mapping
        For every variant, each key and its value.
    random : bool
        Whether they are samples, or else a full grid.
    """

    kind: str
    factors: tuple[Factor, ...]
    coordinates: pd.DataFrame
    changes: tuple[Mapping[str, Value], ...]
    random: bool

    @property
    def keys(self) -> list[str]:
        """All keys that vary."""
        return [key for factor in self.factors for key in factor.keys]


@dataclass(frozen=True, init=False)
class Grid:
    """Full factorial grid: every combination of the levels, the last factor fastest.

    Parameters
    ----------
    factors : mapping or sequence of Factor
        ``{key, or tuple of keys that move together: values, Range or Tolerance}``.
    """

    factors: tuple[Factor, ...]

    def __init__(self, factors: Mapping[Any, Any] | Sequence[Factor]) -> None:
        object.__setattr__(self, "factors", Factor.all_of(factors))

    def draw(self, study: Study) -> DrawnVariants:
        """Return the variants.

        Raises
        ------
        InputError
            If the grid has more variants than can be listed, or a key is not in the study.
        """
        levels = [factor.spread.grid() for factor in self.factors]
        number = math.prod(len(values) for values in levels)
        if number > MOST_VARIANTS:
            raise InputError(
                f"factors: the grid has {number:,} variants, at most {MOST_VARIANTS:,} are allowed"
            )
        columns = [list(column) for column in zip(*itertools.product(*levels), strict=True)]
        return _drawn(f"full factorial grid of {number} variants", self.factors, columns, study, random=False)


@dataclass(frozen=True, init=False)
class _Sampling:
    """Samples drawn from one seed: what `LatinHypercube` and `MonteCarlo` share."""

    factors: tuple[Factor, ...]
    samples: int
    seed: int

    def __init__(
        self, factors: Mapping[Any, Any] | Sequence[Factor], samples: int = 100, seed: int = 0
    ) -> None:
        checked = {
            "factors": Factor.all_of(factors),
            "samples": validation.integer("samples", samples, at_least=1, at_most=MOST_VARIANTS),
            "seed": validation.integer("seed", seed, at_least=0),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def _drawn(self, name: str, shares: FloatArray, study: Study) -> DrawnVariants:
        columns = [factor.spread.at(share) for factor, share in zip(self.factors, shares.T, strict=True)]
        return _drawn(f"{name}, {self.samples} samples, seed {self.seed}", self.factors, columns, study)


@dataclass(frozen=True, init=False)
class LatinHypercube(_Sampling):
    """Latin hypercube: each factor's range in as many equally likely slices as samples, each used once.

    Parameters
    ----------
    factors
        As of `Grid`.
    samples : int
        Number of variants.
    seed : int
        The same seed gives the same variants.

    Raises
    ------
    InputError
        No factors or some that share a key; a number of samples or a seed that is none.

    References
    ----------
    .. [1] M. D. McKay, R. J. Beckman, W. J. Conover, "A comparison of three methods for selecting values of input
       variables in the analysis of output from a computer code", Technometrics 21, 1979.
    """

    def draw(self, study: Study) -> DrawnVariants:
        """Return the variants."""
        from scipy.stats import qmc  # slow to import, and few studies sweep

        hypercube = qmc.LatinHypercube(len(self.factors), seed=np.random.default_rng(self.seed))
        return self._drawn("Latin hypercube", hypercube.random(self.samples), study)


@dataclass(frozen=True, init=False)
class MonteCarlo(_Sampling):
    """Independent random samples; more samples of the same seed keep the first ones.

    Parameters
    ----------
    factors, samples, seed
        As of `LatinHypercube`.

    Raises
    ------
    InputError
        As `LatinHypercube`.
    """

    def draw(self, study: Study) -> DrawnVariants:
        """Return the variants."""
        shares = np.random.default_rng(self.seed).random((self.samples, len(self.factors)))
        return self._drawn("Monte Carlo", shares, study)


Plan = Grid | LatinHypercube | MonteCarlo


def draw_variants(study: Study, grid_or_samples: Any) -> DrawnVariants:
    """Return the variants that a grid, a sampling plan or given samples mean, with every key checked.

    Raises
    ------
    InputError
        A key that the study does not know, or none of whose values it takes; samples that do not fit together.
    """
    if isinstance(grid_or_samples, Plan):
        drawn = grid_or_samples.draw(study)
    elif isinstance(grid_or_samples, Mapping):
        drawn = Grid(grid_or_samples).draw(study)
    elif isinstance(grid_or_samples, pd.DataFrame):
        drawn = _given(grid_or_samples.to_dict("records"), study)
    elif isinstance(grid_or_samples, Sequence) and not isinstance(grid_or_samples, (str, bytes)):
        entries = list(grid_or_samples)
        every_factor = bool(entries) and all(isinstance(one, Factor) for one in entries)
        drawn = Grid(entries).draw(study) if every_factor else _given(entries, study)
    else:
        raise InputError(
            f"grid_or_samples = {grid_or_samples!r} is not allowed: a mapping of keys to values, a Grid, "
            "LatinHypercube or MonteCarlo, or a list of samples is needed"
        )
    _check_keys(study, drawn)
    return drawn


def _given(samples: Sequence[Any], study: Study) -> DrawnVariants:
    if not samples:
        raise InputError("grid_or_samples is empty: at least one sample is needed")
    keys = list(samples[0]) if isinstance(samples[0], Mapping) else []
    for n, sample in enumerate(samples):
        if not isinstance(sample, Mapping) or not sample or set(sample) != set(keys):
            raise InputError(f"grid_or_samples[{n}]: a mapping with the keys {', '.join(keys)} is needed")
    columns = []
    for key in keys:
        try:
            columns.append([plain_value(sample[key]) for sample in samples])
        except InputError as problem:
            raise InputError(f"{key}: {problem}") from None
    factors = Factor.all_of(
        [Factor(key, Levels(tuple(dict.fromkeys(column)))) for key, column in zip(keys, columns, strict=True)]
    )
    return _drawn(f"{len(samples)} given samples", factors, columns, study)


def _drawn(
    kind: str,
    factors: tuple[Factor, ...],
    columns: Sequence[Sequence[Value]],
    study: Study,
    *,
    random: bool = True,
) -> DrawnVariants:
    changes = [_changes(factor, study, column) for factor, column in zip(factors, columns, strict=True)]
    merged = [
        {key: value for part in parts for key, value in part.items()} for parts in zip(*changes, strict=True)
    ]
    names = [factor.name for factor in factors]
    coordinates = pd.DataFrame(dict(zip(names, map(list, columns), strict=True)), columns=names)
    return DrawnVariants(kind, factors, coordinates, tuple(merged), random)


def _changes(factor: Factor, study: Study, values: Sequence[Value]) -> list[dict[str, Value]]:
    """Return, for every value of a factor, the changes of the study's keys as `Study.with_changes` takes them.

    Raises
    ------
    InputError
        A relative change of a key that is no number in the study, or has no value there.
    """
    if not isinstance(factor.spread, Tolerance):
        return [dict.fromkeys(factor.keys, value) for value in values]
    own = {key: study.value(key) for key in factor.keys}
    for key, value in own.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            if value is None:
                study.with_changes({key: 1.0})  # an unknown key is refused here, with the nearest one
            is_what = "the study gives it no value" if value is None else f"it is {value!r} in the study"
            raise InputError(f"{key}: a relative change needs a number, and {is_what}")
    return [{key: value * (1.0 + float(share)) for key, value in own.items()} for share in values]


def _check_keys(study: Study, drawn: DrawnVariants) -> None:
    """Refuse a key of which the study takes no value; a value that it refuses elsewhere is a failed variant."""
    for key in drawn.keys:
        problem: InputError | None = None
        for value in itertools.islice(dict.fromkeys(change[key] for change in drawn.changes), _TRIALS):
            try:
                study.with_changes({key: value})
            except InputError as refused:
                problem = problem or refused
            else:
                break
        else:
            assert problem is not None
            raise problem
