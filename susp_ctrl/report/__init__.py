"""From the data of a study to tables, figures, a PDF and a folder of files. Computes no engineering number."""

from __future__ import annotations

from susp_ctrl.report.saving import SaveError, check_folder
from susp_ctrl.report.study_result import FigureGallery, StudyResult, run_study
