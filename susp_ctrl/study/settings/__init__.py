"""What the study file asks for: typed settings and the strict reader of the file."""

from susp_ctrl.study.settings.audit import (
    AuditSettings,
    Printed,
    PrintedInterval,
    PrintedOptimum,
    PrintedPeak,
    PrintedRoots,
    PrintedRow,
    PrintedTable,
    printed_number,
)
from susp_ctrl.study.settings.fields import SettingError
from susp_ctrl.study.settings.maps import MapSettings
from susp_ctrl.study.settings.references import check_sweep
from susp_ctrl.study.settings.simulation import PadeSettings, RoadSettings, TimeSettings
from susp_ctrl.study.settings.study import FrequencySettings, StabilitySettings, StudySettings, TuningSettings
from susp_ctrl.study.settings.study_file import Study, load_study, new_study
from susp_ctrl.study.settings.variants import AT_LEAST, MOST_VARIANTS, SweepSettings, indicator_limits
from susp_ctrl.study.settings.variation import Factor, Levels, Range, Tolerance, Value, plain_value
from susp_ctrl.study.settings.vehicle import (
    GAIN_UNITS,
    PAPER_SYMBOLS,
    PASSIVE,
    BoxSettings,
    DesignSettings,
    PairSettings,
    feedback_channels,
    gain_unit,
    parameter_unit,
    readable,
)
