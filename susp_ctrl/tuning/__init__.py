"""Tuning of delayed feedback: objectives over many gains and delays at once, the swarm, stability inside it."""

from __future__ import annotations

from susp_ctrl.tuning.objectives import BandMean, BandPeak, Harmonic, RoadRms, SpectralAbscissa
from susp_ctrl.tuning.problem import Limit, TuningProblem
from susp_ctrl.tuning.swarm import pso
from susp_ctrl.tuning.trade_off import ParetoFront, pareto_front
from susp_ctrl.tuning.tuner import tune
