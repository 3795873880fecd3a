"""What the sections of a study share: the plant, the road lags, the designs and their loops."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import control
import numpy as np

from susp_ctrl.arrays import ComplexArray, FloatArray
from susp_ctrl.delay_systems import DelayLTI, close_loop
from susp_ctrl.study.results import Design
from susp_ctrl.study.settings import PASSIVE, DesignSettings, RoadSettings, Study, feedback_channels

Report = Callable[[float], None]
"""Told how far a section is, from 0 to 1."""


@dataclass
class Workbench:
    """The plant of a study and every design known so far, closed to a loop once.

    Attributes
    ----------
    study : Study
    plant : control.StateSpace
    lags : dict of str to float
        Lag (s) of every road input behind the front one.
    designs : list of Design
        Passive first; tuned designs are added as they are found.
    """

    study: Study
    plant: control.StateSpace
    lags: dict[str, float]
    designs: list[Design] = field(default_factory=list)
    _loops: dict[str, DelayLTI] = field(default_factory=dict)

    @classmethod
    def of(cls, study: Study) -> Workbench:
        """Return the workbench of a study with the passive car and the published designs."""
        passive = Design(PASSIVE, "passive", "passive", ())
        published = [_published(design) for design in study.settings.designs]
        return cls(study, study.plant, study.lags, [passive, *published])

    @property
    def speed(self) -> float:
        """Vehicle speed (m/s)."""
        return self.study.settings.vehicle.speed

    def add(self, design: Design) -> None:
        """Add a tuned design."""
        self.designs.append(design)

    @property
    def keys(self) -> list[str]:
        """Keys of all designs known."""
        return [design.key for design in self.designs]

    def design(self, key: str) -> Design:
        """Return a design by its key."""
        return self.designs[self.keys.index(key)]

    def chosen(self, keys: Iterable[str], *, passive: bool = True) -> list[Design]:
        """Return the designs of these keys that are known (all if none is given), passive first or left out."""
        wanted = list(keys) or self.keys
        rest = [self.design(k) for k in wanted if k in self.keys and k != PASSIVE]
        return [self.designs[0], *rest] if passive else rest

    def loop(self, key: str) -> DelayLTI:
        """Return the closed loop of a design; the passive car has no channel."""
        if key not in self._loops:
            self._loops[key] = close_loop(self.plant, self.design(key).channels, name=key)
        return self._loops[key]

    def road_response(
        self, key: str, omega: FloatArray, outputs: Iterable[str], lags: dict[str, float] | None = None
    ) -> ComplexArray:
        """Return the response to one road under all wheels, each a lag later, per road displacement.

        Parameters
        ----------
        key : str
            Design.
        omega : ndarray, shape (n,)
            rad/s.
        outputs : iterable of str
            Output names.
        lags : dict of str to float, optional
            Lag (s) of every road input; those of the study by default.

        Returns
        -------
        ndarray of complex, shape (outputs, n)
        """
        loop, arrival = self.loop(key), self.lags if lags is None else lags
        rows = [loop.output_labels.index(name) for name in outputs]
        values = np.asarray(loop(1j * omega, squeeze=False))[rows]
        columns = [loop.input_labels.index(name) for name in arrival]
        phases = np.exp(-1j * np.outer(list(arrival.values()), omega))
        return np.einsum("ijn,jn->in", values[:, columns], phases)


def _published(settings: DesignSettings) -> Design:
    return Design(
        settings.key, settings.label, "published", feedback_channels(settings.channels), settings.reference
    )


def road_text(road: RoadSettings, speed: float) -> str:
    """Return a road in one sentence, with its numbers."""
    if road.kind == "harmonic":
        return f"harmonic road x_g = {road.amplitude:g} m sin({road.omega:g} rad/s t), {speed:g} m/s"
    if road.kind == "random":
        return f"random road of ISO 8608 class {road.iso_class}, {speed:g} m/s, seed {road.seed}"
    return f"bump of {road.height:g} m height and {road.length:g} m length, {speed:g} m/s"
