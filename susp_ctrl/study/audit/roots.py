"""Audit of printed characteristic roots: those of the model, and those of the matrices with the named misprints.

The printed state equation is x' = A x + B x(t - tau) with x = [x_tf, x_tf', x_tr, x_tr', x_c, x_c', phi, phi']. The
correct A and B are taken from the plant; the study file names every entry that was another one. Whether these
substitutions really give the printed roots is computed, root by root.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import FeedbackChannel, close_loop
from susp_ctrl.errors import InputError
from susp_ctrl.study.audit.expressions import evaluate
from susp_ctrl.study.audit.rows import EXPLAINED, NOT_REPRODUCED, REPRODUCED, AuditRow, agrees
from susp_ctrl.study.sections import Workbench
from susp_ctrl.study.settings import PAPER_SYMBOLS, PrintedRoots, Study, printed_number
from susp_ctrl.vehicle import HalfCar

_PAPER_STATE = (
    "unsprung_displacement_front",
    "unsprung_velocity_front",
    "unsprung_displacement_rear",
    "unsprung_velocity_rear",
    "body_displacement",
    "body_velocity",
    "pitch_angle",
    "pitch_velocity",
)
# Printed roots have more digits than double precision can hold; eigenvalues of the 8 x 8 matrix are good to about
# 1e-13 relative, so agreement to this level is agreement in every digit that a computation can have.
_ALL_DIGITS = 1e-12


@dataclass(frozen=True)
class RootsAudit:
    """Rows and tables of one set of printed roots; the tables as in `AuditSection`."""

    rows: list[AuditRow]
    roots: pd.DataFrame
    substitutions: pd.DataFrame


def audit_roots(bench: Workbench, printed: PrintedRoots, tolerance: float) -> RootsAudit:
    """Hold printed zero-delay roots against the model and against the misprinted matrices."""
    design = bench.design(printed.design)
    undelayed = close_loop(bench.plant, [channel.replace(delay=0.0) for channel in design.channels])
    true = upper_half(undelayed.folded.plant.A)
    given = [(printed_number(root.real), printed_number(root.imaginary)) for root in printed.roots]
    values = np.array([complex(real.value, abs(imaginary.value)) for real, imaginary in given])
    paired = true[_closest(values, true)]

    substitutions = pd.DataFrame()
    misprinted = np.full(values.size, np.nan + 0j)
    if printed.substitutions:
        matrix, substitutions = misprinted_matrix(bench, printed)
        spectrum = upper_half(matrix)
        misprinted = spectrum[_closest(values, spectrum)]

    rows = []
    for n, (root, numbers) in enumerate(zip(printed.roots, given, strict=True)):
        explained = abs(misprinted[n] - values[n]) <= _ALL_DIGITS * abs(values[n])
        evidence = f"eq. (1) with this design and no delay has {_complex_text(paired[n])} 1/s nearest"
        if explained:
            evidence += (
                f"; the state matrix with the {len(printed.substitutions)} named misprints has "
                f"{_complex_text(misprinted[n], 15)} 1/s: the same to {_digits(misprinted[n], values[n])} digits"
            )
        parts = (("real part", numbers[0], paired[n].real), ("imaginary part", numbers[1], paired[n].imag))
        for name, number, computed in parts:
            verdict = REPRODUCED if agrees(number, computed, tolerance) else NOT_REPRODUCED
            # A part that happens to be close while its root is another one does not reproduce the root.
            if verdict == REPRODUCED and abs(paired[n] - values[n]) > tolerance * abs(values[n]):
                verdict = NOT_REPRODUCED
            if verdict == NOT_REPRODUCED and explained:
                verdict = EXPLAINED
            where = f"{root.name}, {name}"
            rows.append(AuditRow(printed.item, where, number, float(computed), "1/s", verdict, evidence))
    table = pd.DataFrame(
        {
            "name": [root.name for root in printed.roots],
            "printed_real": values.real,
            "printed_imaginary": values.imag,
            "misprint_real": misprinted.real,
            "misprint_imaginary": misprinted.imag,
            "true_real": paired.real,
            "true_imaginary": paired.imag,
        }
    )
    return RootsAudit(rows, table, substitutions)


def check_substitutions(study: Study) -> None:
    """Refuse substitutions that the audit would refuse, which comes last of all that is computed.

    Raises
    ------
    InputError
        An expression that is none, or an entry named as correct that is not the one of the model.
    """
    audit, bench = study.settings.audit, Workbench.of(study)
    for printed in () if audit is None else audit.roots:
        if printed.substitutions and printed.design in bench.keys:
            misprinted_matrix(bench, printed)


def misprinted_matrix(bench: Workbench, printed: PrintedRoots) -> tuple[FloatArray, pd.DataFrame]:
    """Return A + B with the substitutions of the study file, and the substitutions with their values.

    Raises
    ------
    InputError
        An entry named as correct that is not the one of the model.
    """
    car = bench.study.vehicle
    if not isinstance(car, HalfCar):
        raise InputError("audit.roots: substitutions refer to a half car")
    channels = bench.design(printed.design).channels
    symbols = {symbol: float(getattr(car, name)) for name, symbol in PAPER_SYMBOLS.items()}
    symbols |= {f"g{n}": channel.gain for n, channel in enumerate(channels, 1)}
    matrices = dict(zip("AB", paper_matrices(bench.plant, channels), strict=True))
    records = []
    for s in printed.substitutions:
        matrix, place = matrices[s.matrix], (s.row - 1, s.column - 1)
        correct, used = evaluate(s.correct, symbols), evaluate(s.used, symbols)
        if abs(correct - matrix[place]) > 1e-9 * max(1.0, abs(correct)):
            raise InputError(
                f"audit.roots: {s.matrix}({s.row}, {s.column}) = {s.correct} = {correct:g} is called correct, "
                f"but the model has {matrix[place]:g} there"
            )
        matrix[place] = used
        records.append(
            {
                "matrix": s.matrix,
                "row": s.row,
                "column": s.column,
                "correct": s.correct,
                "printed": s.used,
                "correct_value": correct,
                "printed_value": used,
                "note": s.note,
            }
        )
    return matrices["A"] + matrices["B"], pd.DataFrame(records)


def paper_matrices(
    plant: control.StateSpace, channels: tuple[FeedbackChannel, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return A and B of x' = A x + B x(t - tau) in the paper's order of states, for a half car.

    The states are outputs of the plant without feed-through, so T = C gives x = T q and A = T A_q T^-1.
    """
    rows = [plant.output_labels.index(name) for name in _PAPER_STATE]
    T = np.asarray(plant.C)[rows]
    A = T @ np.linalg.solve(T.T, np.asarray(plant.A).T).T
    B = np.zeros_like(A)
    for channel in channels:
        actuator = plant.input_labels.index(channel.actuator)
        measured = _PAPER_STATE.index(str(channel.measured))
        B[:, measured] += channel.gain * (T @ np.asarray(plant.B)[:, actuator])
    return A, B


def upper_half(matrix: FloatArray) -> ComplexArray:
    """Return the eigenvalues with imaginary part >= 0."""
    roots = np.linalg.eigvals(matrix).astype(complex)
    scale = float(np.abs(roots).max(initial=1.0))
    return roots[roots.imag >= -1e-12 * scale]


def _closest(values: ComplexArray, candidates: ComplexArray) -> NDArray[np.intp]:
    """Return which candidate belongs to each value: the pairing with the smallest total distance."""
    if values.size > candidates.size:
        raise InputError(
            f"audit.roots: {values.size} printed roots, but the model has {candidates.size} pairs"
        )
    order: NDArray[np.intp] = linear_sum_assignment(np.abs(values[:, None] - candidates[None, :]))[1]
    return order


def _complex_text(value: complex, digits: int = 7) -> str:
    return f"{value.real:.{digits}g} ± {abs(value.imag):.{digits}g}j"


def _digits(a: complex, b: complex) -> int:
    relative = abs(a - b) / abs(b)
    return 16 if relative == 0 else min(16, int(-np.log10(relative)))
