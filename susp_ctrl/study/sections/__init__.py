"""How each part of a study is computed from its settings."""

from susp_ctrl.study.sections.delay_stability import stability_section
from susp_ctrl.study.sections.frequency import frequency_section
from susp_ctrl.study.sections.headlines import headlines
from susp_ctrl.study.sections.map_explorer import map_explorers
from susp_ctrl.study.sections.maps import stability_maps
from susp_ctrl.study.sections.pade import pade_case, pade_verdicts
from susp_ctrl.study.sections.time import EXACT, STATIONARY, build_road, time_case
from susp_ctrl.study.sections.tuning import tuning_run
from susp_ctrl.study.sections.workbench import Report, Workbench
