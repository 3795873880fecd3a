"""A small sweep that several tests compute in their own way, and what it must give."""

from __future__ import annotations

from pathlib import Path

import susp_ctrl as sc

STUDY = Path(__file__).parents[3] / "studies" / "robustness.toml"
DELAYS = ("designs[random_published].channels[1].delay_s", "designs[random_published].channels[2].delay_s")
VARIANTS = 20


def small_plan(samples=VARIANTS):
    return sc.LatinHypercube(
        {
            "vehicle.body_mass_kg": sc.Tolerance(0.1),
            DELAYS: sc.Tolerance(0.1),
            "time[random].road.iso_class": ["A", "C"],
        },
        samples=samples,
        seed=3,
    )


def small_sweep(folder=None, workers=1, **options):
    return sc.sweep(
        sc.load_study(STUDY), small_plan(), workers, designs=["random_published"], folder=folder, **options
    )
