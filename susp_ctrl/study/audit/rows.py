"""One row of the audit: a printed number, the computed one, and the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

from susp_ctrl.study.results import AuditVerdict
from susp_ctrl.study.settings import Printed, printed_number

REPRODUCED: AuditVerdict = "reproduced"
NOT_REPRODUCED: AuditVerdict = "not reproduced"
EXPLAINED: AuditVerdict = "explained by a named misprint"


@dataclass(frozen=True)
class AuditRow:
    """A printed number beside the computed one; fields as in `AuditSection.table`."""

    item: str
    where: str
    printed: Printed
    computed: float
    unit: str
    verdict: AuditVerdict
    evidence: str

    @property
    def relative_difference(self) -> float:
        """The computed value over the printed one, less 1; nan where that is not defined."""
        published = self.printed.value
        return self.computed / published - 1 if published and math.isfinite(self.computed) else math.nan


def agrees(printed: Printed, computed: float, tolerance: float) -> bool:
    """Whether a computed value is the printed one within its last digit or the relative tolerance."""
    if not math.isfinite(computed):
        return False
    # The slack only covers the rounding of a value that stands exactly between two printed digits.
    return abs(computed - printed.value) <= max(
        printed.half_digit * (1 + 1e-9), tolerance * abs(printed.value)
    )


def compared(
    item: str, where: str, text: str, computed: float, unit: str, tolerance: float, evidence: str
) -> AuditRow:
    """Return the row of a number that is reproduced if it agrees, and else is not."""
    printed = printed_number(text)
    verdict = REPRODUCED if agrees(printed, computed, tolerance) else NOT_REPRODUCED
    return AuditRow(item, where, printed, computed, unit, verdict, evidence)


def audit_table(rows: list[AuditRow]) -> pd.DataFrame:
    """Return the table of all rows."""
    return pd.DataFrame(
        {
            "item": [row.item for row in rows],
            "where": [row.where for row in rows],
            "published": [row.printed.value for row in rows],
            "printed": [row.printed.text for row in rows],
            "computed": [row.computed for row in rows],
            "unit": [row.unit for row in rows],
            "relative_difference": [row.relative_difference for row in rows],
            "verdict": [row.verdict for row in rows],
            "evidence": [row.evidence for row in rows],
        }
    )


def audit_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the number of verdicts of each kind by item, and in all."""
    names = {REPRODUCED: "reproduced", NOT_REPRODUCED: "not_reproduced", EXPLAINED: "explained"}
    records = []
    for item in [*dict.fromkeys(table["item"]), "all"]:
        verdicts = table["verdict"] if item == "all" else table.loc[table["item"] == item, "verdict"]
        counts = {name: int((verdicts == verdict).sum()) for verdict, name in names.items()}
        records.append({"item": item, **counts})
    return pd.DataFrame(records)
