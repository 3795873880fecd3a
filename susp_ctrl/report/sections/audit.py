"""Published against computed: every printed number of the source with a verdict and the evidence for it."""

from __future__ import annotations

from susp_ctrl.report.blocks import Block, Column, Section, Table, Text
from susp_ctrl.report.formatting import grouped, prose
from susp_ctrl.study.results import AuditSection, StudyRun

_LONGEST = 11
_SIGNS = {
    "reproduced": "✓ reproduced",
    "not reproduced": "✗ not reproduced",
    "explained by a named misprint": "≈ explained by a misprint",
}


def audit_section(run: StudyRun) -> Section | None:
    """Return the section on published numbers, or None if the study has none."""
    data = run.audit
    if data is None:
        return None
    blocks: list[Block] = [
        Text(
            "Every number is computed from equation (1) of the source with its own parameters and set beside the "
            "printed one; the model is never bent to force agreement."
        ),
        Table(
            key="audit_summary",
            caption="Printed numbers of the source, counted by verdict.",
            frame=data.summary,
            columns=(
                Column("item", "where it is printed"),
                Column("reproduced", "✓ reproduced", "integer"),
                Column("not_reproduced", "✗ not reproduced", "integer"),
                Column("explained", "≈ explained by a misprint", "integer"),
            ),
        ),
        *_comparison(data),
    ]
    if data.roots is not None:
        blocks.append(
            Table(
                key="audit_roots",
                caption="Eq. (15) of the source: roots as printed, of the misprinted matrix, and of the true loop.",
                frame=data.roots,
                columns=tuple(
                    Column(f"{kind}_{part}", f"{title}, {short}", "fixed", 4)
                    for kind, title in (
                        ("printed", "printed"),
                        ("misprint", "misprinted matrix"),
                        ("true", "eq. (1)"),
                    )
                    for part, short in (("real", "Re (1/s)"), ("imaginary", "Im (rad/s)"))
                ),
            )
        )
    if data.substitutions is not None:
        blocks.append(
            Table(
                key="audit_substitutions",
                caption="The misprints that give the printed roots: entries of the state matrix that differ.",
                frame=data.substitutions,
                columns=(
                    Column("matrix", "matrix"),
                    Column("row", "row", "integer"),
                    Column("column", "column", "integer"),
                    Column("correct", "correct", "formula"),
                    Column("printed", "as printed", "formula"),
                    Column("correct_value", "correct value", "number", 5),
                    Column("printed_value", "printed value", "number", 5),
                ),
            )
        )
    return Section("Published against computed", tuple(blocks))


def _shortened(printed: str) -> str:
    # The source prints roots with thirty digits; the CSV file holds them all.
    text = grouped(printed) if printed[-1:].isdigit() and "e" not in printed else prose(printed)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _comparison(data: AuditSection) -> list[Block]:
    # The same evidence serves many numbers: it is set once, as a numbered list below the table.
    evidence = [text for text in dict.fromkeys(data.table["evidence"]) if text]
    numbers = {text: f"[{position}]" for position, text in enumerate(evidence, 1)}
    shown = data.table.assign(
        note=data.table["evidence"].map(numbers).fillna(""),
        short=data.table["printed"].map(_shortened),
        percent=100.0 * data.table["relative_difference"],
    )
    table = Table(
        key="audit",
        caption="Published against computed: every printed number of the source.",
        frame=data.table,
        shown=shown,
        columns=(
            Column("where", "where", "long"),
            Column("short", "printed", "written"),
            Column("computed", "computed", "number", 5),
            Column("unit", "unit", "unit"),
            Column("percent", "difference (%)", "change"),
            Column("verdict", "verdict", words=_SIGNS),
            Column("note", "evidence"),
        ),
        group="item",
        note="Difference: computed against printed, in percent of the printed value; ▼ computed is less, ▲ more. The "
        "numbers in brackets lead to the list below.",
    )
    return [table, Text(items=tuple(evidence), numbered=True)] if evidence else [table]
