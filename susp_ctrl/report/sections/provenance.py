"""Provenance: study file and its hash, versions, seeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from susp_ctrl.report.blocks import Column, Section, Table, Text

if TYPE_CHECKING:
    from susp_ctrl.study.result import StudyRun


def provenance_section(run: StudyRun) -> Section:
    """Return the section that says what was run with what."""
    source = run.provenance
    rows = [("study file", source.study_file or "built in Python"), ("SHA-256", source.study_sha256 or "–")]
    rows += [(f"version of {name}", version) for name, version in source.versions.items()]
    rows += [(f"seed of {name}", str(seed)) for name, seed in source.seeds.items()]
    return Section(
        "Provenance",
        (
            Text(
                "The same study file, seeds, versions and machine give the same CSV files, byte for byte. "
                "The file manifest.json beside this document lists every file with its SHA-256."
            ),
            Table(
                key="provenance",
                caption="What this report was made from.",
                frame=pd.DataFrame(rows, columns=["what", "value"]),
                columns=(Column("what", "what"), Column("value", "value")),
            ),
        ),
    )
