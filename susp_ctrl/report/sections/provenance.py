"""Provenance: study file and its hash, versions, seeds."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

import pandas as pd

from susp_ctrl.report.blocks import Column, Section, Table, Text
from susp_ctrl.study.results import StudyRun


def all_versions(run: StudyRun) -> dict[str, str]:
    """Return the versions that computed the study and those that drew and set the report."""
    found = dict(run.provenance.versions)
    for package in ("matplotlib", "typst"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def provenance_section(run: StudyRun) -> Section:
    """Return the section that says what was run with what."""
    source = run.provenance
    rows = [("study file", source.study_file or "built in Python"), ("SHA-256", source.study_sha256 or "–")]
    rows += [(f"version of {name}", number) for name, number in all_versions(run).items()]
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
