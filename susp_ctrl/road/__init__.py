"""Roads as functions of time: harmonic, ISO 8608 random, bumps, measured profiles, two tracks.

A road gives its elevation at any time (`profile`), its power spectral density where it has one, and one
signal per road input of a plant (`inputs`), each wheel meeting the same road a lag later.
"""

from __future__ import annotations

from susp_ctrl.road.bump import BumpRoad
from susp_ctrl.road.filtered_noise import FilteredNoiseRoad
from susp_ctrl.road.harmonic import HarmonicRoad
from susp_ctrl.road.iso8608 import ISO_8608_CLASSES, Iso8608Spectrum
from susp_ctrl.road.measured import MeasuredRoad
from susp_ctrl.road.random_road import RandomRoad
from susp_ctrl.road.road_signals import RoadSignal
from susp_ctrl.road.two_tracks import TwoTrackRoad
