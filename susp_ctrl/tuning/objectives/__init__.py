"""What a design is judged by: readings of the road response and the rightmost root, for many designs at once."""

from __future__ import annotations

from susp_ctrl.tuning.objectives.abscissa import SpectralAbscissa
from susp_ctrl.tuning.objectives.joint_evaluation import JointEvaluation
from susp_ctrl.tuning.objectives.road_response import BandMean, BandPeak, Harmonic, RoadRms
from susp_ctrl.tuning.objectives.sampled_objective import (
    BoundObjective,
    Objective,
    SampledObjective,
    response_and_slopes,
)
