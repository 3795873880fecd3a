"""Independent oracle of the half car with delayed wheel-displacement feedback.

Written straight from eq. (1) of K. Wu, C. Ren, "Control and Stability Analysis of Double Time-Delay Active
Suspension Based on Particle Swarm Optimization", Shock and Vibration, 2020, one Newton equation per line. It
imports nothing of the package under test and holds its own copy of Table 1.

Coordinates q = (x_tf, x_tr, x_c, phi), suspension attachment points x_c - Lf phi (front) and x_c + Lr phi
(rear); a positive actuator force pushes the body up and the wheel down:

    mtf x_tf'' = -ktf (x_tf - x_gf) + F_f - f_f,     F_f = ksf s_f + csf s_f',    s_f = x_c - Lf phi - x_tf
    mtr x_tr'' = -ktr (x_tr - x_gr) + F_r - f_r,     F_r = ksr s_r + csr s_r',    s_r = x_c + Lr phi - x_tr
    m   x_c''  = -(F_f + F_r) + f_f + f_r
    I   phi''  = Lf (F_f - f_f) - Lr (F_r - f_r)
    f_f(t) = g1 x_tf(t - tau1),   f_r(t) = g2 x_tr(t - tau2)
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

TABLE_1: Mapping[str, float] = {
    "m": 690.0,
    "I": 1200.0,
    "mtf": 40.5,
    "mtr": 45.4,
    "ktf": 192000.0,
    "ktr": 192000.0,
    "ksf": 17000.0,
    "ksr": 22000.0,
    "Lf": 1.25,
    "Lr": 1.51,
    "csf": 1500.0,
    "csr": 1500.0,
}

RIDE_OUTPUTS = (
    "body_acceleration",
    "pitch_acceleration",
    "suspension_deflection_front",
    "suspension_deflection_rear",
    "tire_deflection_front",
    "tire_deflection_rear",
    "unsprung_displacement_front",
    "unsprung_displacement_rear",
)


def dynamic_stiffness(s, gains=(0.0, 0.0), delays=(0.0, 0.0), car=TABLE_1):
    """4 x 4 matrix Z(s) of Z(s) q = [ktf x_gf, ktr x_gr, 0, 0], delayed feedback included.

    `s` is a complex scalar or array; the result has shape s.shape + (4, 4). det Z(s) = 0 is the exact
    characteristic equation of the closed loop.
    """
    s = np.asarray(s, dtype=complex)
    front = car["ksf"] + car["csf"] * s  # force per suspension deflection
    rear = car["ksr"] + car["csr"] * s
    fed_f = gains[0] * np.exp(-delays[0] * s)  # actuator force per wheel displacement
    fed_r = gains[1] * np.exp(-delays[1] * s)
    lf, lr = car["Lf"], car["Lr"]
    z = np.zeros((*s.shape, 4, 4), dtype=complex)
    z[..., 0, 0] = car["mtf"] * s**2 + car["ktf"] + front + fed_f
    z[..., 0, 2] = -front
    z[..., 0, 3] = lf * front
    z[..., 1, 1] = car["mtr"] * s**2 + car["ktr"] + rear + fed_r
    z[..., 1, 2] = -rear
    z[..., 1, 3] = -lr * rear
    z[..., 2, 0] = -front - fed_f
    z[..., 2, 1] = -rear - fed_r
    z[..., 2, 2] = car["m"] * s**2 + front + rear
    z[..., 2, 3] = -lf * front + lr * rear
    z[..., 3, 0] = lf * (front + fed_f)
    z[..., 3, 1] = -lr * (rear + fed_r)
    z[..., 3, 2] = -lf * front + lr * rear
    z[..., 3, 3] = car["I"] * s**2 + lf**2 * front + lr**2 * rear
    return z


def displacement_response(s, gains=(0.0, 0.0), delays=(0.0, 0.0), car=TABLE_1):
    """Response of (x_tf, x_tr, x_c, phi) to (x_gf, x_gr); shape s.shape + (4, 2)."""
    z = dynamic_stiffness(s, gains, delays, car)
    load = np.zeros((4, 2), dtype=complex)
    load[0, 0] = car["ktf"]
    load[1, 1] = car["ktr"]
    return np.linalg.solve(z, np.broadcast_to(load, (*z.shape[:-2], 4, 2)))


def ride_response(s, gains=(0.0, 0.0), delays=(0.0, 0.0), car=TABLE_1):
    """Response of the eight `RIDE_OUTPUTS` to (x_gf, x_gr); shape s.shape + (8, 2)."""
    s = np.asarray(s, dtype=complex)
    q = displacement_response(s, gains, delays, car)
    x_tf, x_tr, x_c, phi = (q[..., k, :] for k in range(4))
    s2 = s[..., None] ** 2
    x_gf, x_gr = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    rows = [
        s2 * x_c,
        s2 * phi,
        x_c - car["Lf"] * phi - x_tf,
        x_c + car["Lr"] * phi - x_tr,
        x_tf - x_gf,
        x_tr - x_gr,
        x_tf,
        x_tr,
    ]
    return np.stack(rows, axis=-2)


def characteristic_function(s, gains=(0.0, 0.0), delays=(0.0, 0.0), car=TABLE_1):
    """det Z(s) / (mtf mtr m I): monic characteristic quasi-polynomial of degree 8."""
    scale = car["mtf"] * car["mtr"] * car["m"] * car["I"]
    return np.linalg.det(dynamic_stiffness(s, gains, delays, car)) / scale
