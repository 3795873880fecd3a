"""What was computed: data classes without any computation, and the file that keeps them."""

from susp_ctrl.study.results.delay_stability import BoxProof, StabilitySection, SweptLine
from susp_ctrl.study.results.maps import MapAxis, MapExplorer, StabilityMapCase
from susp_ctrl.study.results.storage import RESULTS, read_run, write_run
from susp_ctrl.study.results.study_run import (
    AuditSection,
    AuditVerdict,
    Design,
    FrequencySection,
    PadeCase,
    Provenance,
    StudyRun,
    TimeCase,
    TuningRun,
    VehicleSection,
)
