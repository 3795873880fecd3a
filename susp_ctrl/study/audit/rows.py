"""One row of the audit: a printed number, the computed one, and the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

from susp_ctrl.study.results.study_run import AuditVerdict
from susp_ctrl.study.settings.audit import Printed, printed_number

REPRODUCED: AuditVerdict = "reproduced"
NOT_REPRODUCED: AuditVerdict = "not reproduced"
EXPLAINED: AuditVerdict = "explained by a named misprint"

COLUMNS = [
    "item",
    "where",
    "published",
    "printed",
    "computed",
    "unit",
    "relative_difference",
    "verdict",
    "evidence",
]


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

    def record(self) -> dict[str, object]:
        """Return the row of the table."""
        published = self.printed.value
        relative = self.computed / published - 1 if published and math.isfinite(self.computed) else math.nan
        return {
            "item": self.item,
            "where": self.where,
            "published": published,
            "printed": self.printed.text,
            "computed": self.computed,
            "unit": self.unit,
            "relative_difference": relative,
            "verdict": self.verdict,
            "evidence": self.evidence,
        }


def agrees(printed: Printed, computed: float, tolerance: float) -> bool:
    """Whether a computed value is the printed one within its last digit or the relative tolerance."""
    if not math.isfinite(computed):
        return False
    # The slack only covers the rounding of a value that stands exactly between two printed digits.
    return abs(computed - printed.value) <= max(
        printed.half_digit * (1 + 1e-9), tolerance * abs(printed.value)
    )


def compared(
    item: str,
    where: str,
    text: str,
    computed: float,
    unit: str,
    tolerance: float,
    evidence: str,
    explanation: str | None = None,
) -> AuditRow:
    """Return the row of a number that is reproduced if it agrees, else explained if there is an explanation."""
    printed = printed_number(text)
    if agrees(printed, computed, tolerance):
        return AuditRow(item, where, printed, computed, unit, REPRODUCED, evidence)
    verdict = NOT_REPRODUCED if explanation is None else EXPLAINED
    return AuditRow(item, where, printed, computed, unit, verdict, explanation or evidence)


def audit_table(rows: list[AuditRow]) -> pd.DataFrame:
    """Return the table of all rows."""
    return pd.DataFrame([row.record() for row in rows], columns=COLUMNS)


def audit_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the number of verdicts of each kind by item, and in all."""
    names = {REPRODUCED: "reproduced", NOT_REPRODUCED: "not_reproduced", EXPLAINED: "explained"}
    records = []
    for item in [*dict.fromkeys(table["item"]), "all"]:
        chosen = table if item == "all" else table[table["item"] == item]
        counts = {name: int((chosen["verdict"] == verdict).sum()) for verdict, name in names.items()}
        records.append({"item": item, **counts})
    return pd.DataFrame(records, columns=["item", "reproduced", "not_reproduced", "explained"])
