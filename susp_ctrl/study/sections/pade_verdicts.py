"""Whether Padé approximations tell the truth about stability."""

from __future__ import annotations

import numpy as np
import pandas as pd

from susp_ctrl.delay_systems import spectral_abscissa, stability
from susp_ctrl.study.sections.workbench import Workbench
from susp_ctrl.study.settings.simulation import PadeSettings

_WORDS = {True: "stable", False: "unstable", None: "undecided"}


def pade_verdicts(bench: Workbench, settings: PadeSettings) -> pd.DataFrame:
    """Set what every order says about the stability of some designs beside the exact verdict.

    Parameters
    ----------
    bench : Workbench
    settings : PadeSettings
        `verdicts` names the designs, `orders` the orders.

    Returns
    -------
    DataFrame
        As `StudyRun.pade_verdicts`.
    """
    rows = []
    for key in settings.verdicts:
        if key not in bench.keys:
            continue  # a design of a search that was not run
        loop = bench.loop(key)
        exact, abscissa = stability(loop).stable, spectral_abscissa(loop)
        for order in settings.orders:
            rightmost = float(np.linalg.eigvals(loop.pade(order).A).real.max())
            says = rightmost < 0.0
            rows.append((key, order, _WORDS[says], rightmost, _WORDS[exact], abscissa, says is exact))
    columns = ["design", "order", "pade_says", "pade_abscissa", "exact", "exact_abscissa", "right"]
    return pd.DataFrame(rows, columns=columns)
