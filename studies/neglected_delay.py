"""What a delay does to a controller that was designed without it: LQR and skyhook on a half car.

Both are designed for an immediate force. LQR minimises

    integral  x_c''^2 + phi''^2 + q_s (s_f^2 + s_r^2) + q_t (t_f^2 + t_r^2) + r (f_f^2 + f_r^2)  dt

with deflections s of the suspension and t of the tires (`control.lqr`; deflections and velocities are measured), once
for comfort and once, with a larger q_t, for wheels that keep to the ground; skyhook damps the body's velocity at each
axle, f = -c v. Then the same gains act through a delay of 1 to 50 ms in both actuators. The delay margin is exact
(`sweep_delays`), and so are the RMS values on a random road (`stationary_rms`).

The best controller without delay is not the best one with it. LQR for comfort halves the body's acceleration, but has
lost all of that gain at 30 ms while it stays stable all along: a delay margin alone does not warn. LQR for road holding
loses its gain within 10 ms and stability at 17 ms. Skyhook promises less and keeps most of it.

Run it with ``python studies/neglected_delay.py``; it prints two tables and saves a figure in ``out``.

References
----------
D. Hrovat, "Survey of advanced suspension developments and related optimal control applications", Automatica 33(10),
1997.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import control as ct
import numpy as np
import pandas as pd

import susp_ctrl as sc

CAR = sc.HalfCar()
SPEED = 20.0  # m/s
DELAYS = (0.0, 0.001, 0.002, 0.005, 0.010, 0.015, 0.020, 0.030, 0.040, 0.050)  # s
SHOWN = ("body_acceleration", "pitch_acceleration", "suspension_deflection_front", "tire_deflection_front")
FORCES = ("force_front", "force_rear")
MEASURED = [  # as many as states: the car's motion relative to the road
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
    "body_velocity",
    "pitch_velocity",
    "unsprung_velocity_front",
    "unsprung_velocity_rear",
]


def lqr_gain(plant: ct.StateSpace, wheels: float) -> np.ndarray:
    """Return the feedback f = -K (deflections, velocities) of the cost with q_t = `wheels` (1/s4), shape (2, 8)."""
    weights = {  # per squared unit of the output
        "body_acceleration": 1.0,
        "pitch_acceleration": 1.0,
        "suspension_deflection_front": 400.0,
        "suspension_deflection_rear": 400.0,
        "tire_deflection_front": wheels,
        "tire_deflection_rear": wheels,
    }
    judged = plant[list(weights), list(FORCES)]
    W = np.diag(list(weights.values()))
    Q, N = judged.C.T @ W @ judged.C, judged.C.T @ W @ judged.D
    R = judged.D.T @ W @ judged.D + 1e-7 * np.eye(2)
    K, _, _ = ct.lqr(judged.A, judged.B, Q, R, N)
    return np.asarray(K @ np.linalg.inv(plant[MEASURED, 0].C))


def skyhook_gain(damping: float = 3000.0) -> np.ndarray:
    """Return the feedback f = -c (velocity of the body above the axle), shape (2, 8)."""
    K = np.zeros((2, len(MEASURED)))
    K[:, MEASURED.index("body_velocity")] = damping
    K[:, MEASURED.index("pitch_velocity")] = damping * np.array(
        [-CAR.axle_distance_front, CAR.axle_distance_rear]
    )
    return K


def controlled(plant: ct.StateSpace, K: np.ndarray, delays: tuple[float, float]) -> sc.DelayLTI:
    """Return the car under f_k(t) = -K_k (deflections, velocities)(t - delay_k)."""
    commands = [f"command_{force}" for force in FORCES]
    seen = plant[MEASURED, :]
    measured = ct.ss(
        plant.A,
        plant.B,
        np.vstack([plant.C, -K @ seen.C]),
        np.vstack([plant.D, -K @ seen.D]),
        inputs=plant.input_labels,
        outputs=[*plant.output_labels, *commands],
    )
    return sc.close_loop(
        measured,
        [
            sc.FeedbackChannel(command, force, gain=1.0, delay=delay)
            for command, force, delay in zip(commands, FORCES, delays, strict=True)
        ],
    )


def designs() -> dict[str, np.ndarray]:
    """Return the feedbacks by name."""
    plant = CAR.plant()
    return {
        "LQR, comfort": lqr_gain(plant, 4e3),
        "LQR, road holding": lqr_gain(plant, 2e5),
        "skyhook": skyhook_gain(),
    }


def margins(up_to: float = 0.5) -> pd.DataFrame:
    """Return the delay margins (s): delay in both actuators, or in one of them."""
    lines = {"both actuators": (1.0, 1.0), "front alone": (1.0, 0.0), "rear alone": (0.0, 1.0)}
    plant = CAR.plant()
    rows = {
        name: {
            line: sc.sweep_delays(controlled(plant, K, (0.0, 0.0)), direction=way, up_to=up_to).delay_margin
            for line, way in lines.items()
        }
        for name, K in designs().items()
    }
    return pd.DataFrame(rows).T


def study(delays: Iterable[float] = DELAYS, iso_class: str = "C") -> pd.DataFrame:
    """Return verdict, abscissa (1/s) and RMS as multiples of the passive car; nan where the loop is unstable."""
    plant = CAR.plant()
    road = sc.RandomRoad(iso_class=iso_class, speed=SPEED)
    lags = {"road_front": 0.0, "road_rear": CAR.axle_lag(SPEED)}
    passive = sc.stationary_rms(plant, road, lags).set_index("indicator")["value"]
    rows = []
    for name, K in designs().items():
        for tau in delays:
            loop = controlled(plant, K, (tau, tau))
            verdict = sc.stability(loop)
            row = {
                "design": name,
                "delay_ms": 1e3 * tau,
                "stable": verdict.stable,
                "abscissa": verdict.abscissa,
            }
            rms = pd.Series(np.nan, index=passive.index)
            if verdict.stable:
                rms = sc.stationary_rms(loop, road, lags, known_stable=True).set_index("indicator")["value"]
            rows.append(row | {output: rms[output] / passive[output] for output in SHOWN})
    return pd.DataFrame(rows)


def figure(table: pd.DataFrame, limits: pd.DataFrame):
    """Draw the RMS values over the delay; where a curve ends, the loop is unstable from its delay margin on."""
    import matplotlib.pyplot as plt

    drawing, axes = plt.subplots(1, len(SHOWN), figsize=(11, 3), sharex=True, layout="constrained")
    marks = dict(zip(limits.index, ("o", "^", "s"), strict=True))
    colours = dict(zip(limits.index, ("C0", "C2", "C1"), strict=True))
    for ax, output in zip(axes, SHOWN, strict=True):
        for name, rows in table.groupby("design", sort=False):
            ax.plot(rows["delay_ms"], rows[output], label=name, color=colours[name], marker=marks[name])
            margin = 1e3 * limits.loc[name, "both actuators"]
            if margin <= table["delay_ms"].max():
                ax.axvline(margin, color=colours[name], linestyle=":", label=f"delay margin of {name}")
        ax.axhline(1.0, color="black", linewidth=0.8, label="passive")
        ax.set(title=output.replace("_", " "), xlabel="delay (ms)", ylim=(0.0, 3.0))
    axes[0].set_ylabel("RMS over passive")
    axes[0].legend(fontsize="small")
    return drawing


def main() -> None:
    """Print the margins and the table, and save the figure."""
    limits, table = margins(), study()
    print("delay margins in ms:")
    print((1e3 * limits).round(2).to_string())
    print("\nRMS on a road of class C at 20 m/s, as multiples of the passive car:")
    print(table.round(4).to_string(index=False))
    target = Path("out") / "neglected_delay.png"
    target.parent.mkdir(exist_ok=True)
    figure(table, limits).savefig(target, dpi=150)
    print(f"\n{target}")


if __name__ == "__main__":
    main()
