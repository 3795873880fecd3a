"""The books of a sweep: crossings found, counts made, and the tables made of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems.model.lft import FloatArray


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings along the line, one entry per place: degree, and the change ``roots`` of unstable roots.

    `complete` tells that the search proves that none is missing, `none_ever` that there is none for any tau.
    """

    tau: FloatArray
    omega: FloatArray
    degree: np.ndarray
    roots: np.ndarray
    complete: bool
    none_ever: bool
    method: str

    def joined(self, tau: FloatArray, omega: FloatArray, degree: np.ndarray, roots: np.ndarray) -> Crossings:
        """Return these crossings and others."""
        return replace(
            self,
            tau=np.append(self.tau, tau),
            omega=np.append(self.omega, omega),
            degree=np.append(self.degree, degree),
            roots=np.append(self.roots, roots),
        )


@dataclass(frozen=True, eq=False)
class Books:
    """Intervals between events, the counts made at some tau, what is missing there, and whether all agree."""

    edges: FloatArray
    roots: np.ndarray
    counted: dict[float, int]
    missing: dict[float, int]
    closed: bool
    message: str


def nothing_found(method: str, none_ever: bool) -> Crossings:
    """Return no crossings, proven to be all there are."""
    empty, whole = np.zeros(0), np.zeros(0, dtype=int)
    return Crossings(empty, empty, whole, whole, True, none_ever, method)


def merged(values: FloatArray, tolerance: FloatArray) -> FloatArray:
    """Sort and keep one of each group of equal values; each has its own tolerance."""
    order = np.argsort(values, kind="stable")
    ordered, reach = values[order], tolerance[order]
    return ordered[np.append(True, np.diff(ordered) > reach[1:] + reach[:-1])] if ordered.size else ordered


def crossing_table(found: Crossings, edges: FloatArray, roots: np.ndarray) -> pd.DataFrame:
    """One row per crossing root pair, in the order of tau, with the counts around its group."""
    order = np.lexsort((found.omega, found.tau))
    repeats = np.maximum(np.abs(found.degree[order]), 1)
    group = (
        np.argmin(np.abs(found.tau[:, None] - edges), axis=1) if found.tau.size else np.zeros(0, dtype=int)
    )
    net = np.zeros(edges.size, dtype=int)
    np.add.at(net, group, found.roots)
    # At the ends of the line one side has no interval: there the change itself says what it would be.
    before = np.append(roots[0] - net[0] if roots[0] >= 0 else -1, roots)
    after = np.append(roots, roots[-1] + net[-1] if roots[-1] >= 0 else -1)
    position = np.repeat(group[order], repeats)
    return pd.DataFrame(
        {
            "tau": np.repeat(found.tau[order], repeats),
            "omega": np.repeat(found.omega[order], repeats),
            "tendency": np.repeat(np.sign(found.degree[order]), repeats).astype(int),
            "unstable_before": before[position],
            "unstable_after": after[position],
        }
    )
