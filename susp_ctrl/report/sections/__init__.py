"""The chapters of a report, one file each: a function of the study's data object to a `Section`."""

from __future__ import annotations

from susp_ctrl.report.blocks import Section
from susp_ctrl.report.sections.audit import audit_section
from susp_ctrl.report.sections.delay_stability import stability_section
from susp_ctrl.report.sections.frequency import frequency_section
from susp_ctrl.report.sections.maps import maps_section
from susp_ctrl.report.sections.pade import pade_section
from susp_ctrl.report.sections.provenance import provenance_section
from susp_ctrl.report.sections.time import time_sections
from susp_ctrl.report.sections.tuning import tuning_section
from susp_ctrl.report.sections.vehicle import model_section, parameters_section
from susp_ctrl.study.results import StudyRun


def sections_of(run: StudyRun) -> tuple[Section, ...]:
    """Return the chapters of the report on a run, in reading order; what the study does not hold is left out."""
    chapters = [
        parameters_section(run),
        model_section(run),
        audit_section(run),
        frequency_section(run),
        tuning_section(run),
        stability_section(run),
        maps_section(run),
        *time_sections(run),
        pade_section(run),
        provenance_section(run),
    ]
    return tuple(chapter for chapter in chapters if chapter is not None)
