"""The testbed's equations of motion from its energies and Rayleigh's function R: eqs. (1)-(7) of the paper that README.md names.

Eqs. (8)-(11), which the FMU uses, only confirm a correction and the sign of the torques, so the results are an independent check. The
second derivatives of T, R and V are exact, because T, R and V are quadratic forms. The caller chooses the number type: floats for
speed, or mpmath numbers for more digits.

Two errors of the paper are corrected, as its other equations and its text confirm: theta7 is pitch and theta8 is roll (eq. 1, eq. 4a,
Sec. 4), and the last spring of eq. (6) is k2 (K of eq. 8). c and k of Table 1 are per degree, and are converted for use with rad.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

#: Table 1 as printed: J2, J3, H3 in kg.m2; c1, c2, c3 in N.m.s/deg; k1, k2 in N.m/deg. M, N: Sec. 3.1.
TABLE_1 = {
    "J2": "3.8681291e-3",
    "J3": "1.2750004e-2",
    "H3": "4.2363841e-2",
    "c1": "7.83e-3",
    "c2": "8.35e-3",
    "c3": "6.66e-3",
    "k1": "2.11",
    "k2": "0.76",
    "M": "4",
    "N": "7",
}
PER_DEGREE = tuple(name for name in TABLE_1 if name[0] in "ck")
#: The Real parameters; M and N are numbers of lobes and rollers.
REAL = tuple(name for name in TABLE_1 if name not in ("M", "N"))


def varied(factors) -> dict[str, Any]:
    """Returns Table 1 in SI units with each Real parameter multiplied by its factor; M and N are unchanged."""
    table = table_1()
    return {**table, **{name: table[name] * factor for name, factor in zip(REAL, factors, strict=True)}}


# Order of the six angles in every quadratic form below.
TH1, TH2, TH3, TH4, TH5, TH6 = range(6)
MOTOR, SHAFT, CARRIER = slice(0, 2), slice(2, 4), slice(4, 6)


def table_1(number=float, pi=np.pi) -> dict[str, Any]:
    """Returns Table 1 by symbol, in SI units (kg.m2, N.m.s/rad, N.m/rad); `number` turns the printed text into a number."""
    si = {name: number(text) for name, text in TABLE_1.items()}
    for name in PER_DEGREE:
        si[name] = si[name] * 180 / pi
    return si


def pitch_roll(th5, th6, p):
    """Returns theta7 (pitch) and theta8 (roll) of the output shaft by eq. (1), or their rates from rates."""
    return (th5 + th6) / 2, p["N"] * (th5 - th6) / (2 * p["M"])


def kinetic_energy(w, p):
    """Returns T in J from the six rates w (rad/s); eqs. (3)-(5) without the motors, whose motion is prescribed."""
    w7, w8 = pitch_roll(w[TH5], w[TH6], p)
    return (p["J2"] * w[TH5] ** 2 + p["J2"] * w[TH6] ** 2 + p["H3"] * w7**2 + p["J3"] * w8**2) / 2


def potential_energy(th, p):
    """Returns V in J from the six angles th (rad); eq. (6) with k2 in its last term."""
    return (
        p["k1"] * (th[TH1] - th[TH3]) ** 2
        + p["k1"] * (th[TH2] - th[TH4]) ** 2
        + p["k2"] * (th[TH3] - th[TH5]) ** 2
        + p["k2"] * (th[TH4] - th[TH6]) ** 2
    ) / 2


def dissipation(w, p):
    """Returns Rayleigh's function in W from the six rates w (rad/s); eq. (7)."""
    w7, w8 = pitch_roll(w[TH5], w[TH6], p)
    return (
        p["c1"] * (w[TH1] - w[TH3]) ** 2
        + p["c1"] * (w[TH2] - w[TH4]) ** 2
        + p["c2"] * (w[TH3] - w[TH5]) ** 2
        + p["c2"] * (w[TH4] - w[TH6]) ** 2
        + p["c3"] * w7**2
        + p["c3"] * w8**2
    ) / 2


def hessian(form, p):
    """Returns the exact second derivatives (6, 6) of a quadratic form Q of six variables: Q(e_i + e_j) - Q(e_i) - Q(e_j)."""
    zero = p["J2"] * 0
    e = [[zero + (i == j) for j in range(6)] for i in range(6)]
    q = [form(ei, p) for ei in e]
    h = np.array([[form([a + b for a, b in zip(e[i], e[j])], p) - q[i] - q[j] for j in range(6)] for i in range(6)])
    return h


def inverse2(a):
    """Returns the inverse of a (2, 2) array of any number type."""
    det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    return np.array([[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]) / det


@dataclass(frozen=True)
class LinearModel:
    """x' = a x + b_angle theta + b_rate theta', tau = c x + d_angle theta + d_rate theta'.

    x = (theta3, theta4, theta5, theta6, theta5', theta6') in rad and rad/s; theta the two motor angles in rad; tau in
    N.m. Shapes: a (6, 6), b_* (6, 2), c (2, 6), d_* (2, 2).
    """

    a: np.ndarray
    b_angle: np.ndarray
    b_rate: np.ndarray
    c: np.ndarray
    d_angle: np.ndarray
    d_rate: np.ndarray
    parameters: dict

    def impulse(self, jump):
        """Returns the change of x when the motor angles jump by `jump` (2,) rad.

        Lagrange's equation is integrated over the instant of the jump, where terms with angles vanish. theta5 and theta6 do
        not jump, because they have inertia. With [q] for the jump of q, this leaves D [q] + M [q'] = -C jump, with the second
        derivatives M of T, and the blocks of the second derivatives of R that belong to q (D), and to q and the motors (C).
        """
        h_d, h_t = hessian(dissipation, self.parameters), hessian(kinetic_energy, self.parameters)
        jump_shaft = -inverse2(h_d[SHAFT, SHAFT]) @ (h_d[SHAFT, MOTOR] @ jump)
        jump_rate = -inverse2(h_t[CARRIER, CARRIER]) @ (h_d[CARRIER, SHAFT] @ jump_shaft + h_d[CARRIER, MOTOR] @ jump)
        return np.concatenate([jump_shaft, 0 * jump, jump_rate])

    def outputs(self, x, theta, rate) -> dict[str, Any]:
        """Returns all outputs of the FMU by name, at state x (6,), motor angles theta (2,) and their rates (2,)."""
        tau = self.c @ x + self.d_angle @ theta + self.d_rate @ rate
        pitch, roll = pitch_roll(x[2], x[3], self.parameters)
        pitch_rate, roll_rate = pitch_roll(x[4], x[5], self.parameters)
        return {
            "tau1": tau[0],
            "tau2": tau[1],
            "pitch": pitch,
            "roll": roll,
            "pitch_rate": pitch_rate,
            "roll_rate": roll_rate,
            "theta3": x[0],
            "theta4": x[1],
        }


def described_outputs() -> dict[str, str]:
    """Returns the unit of each output in the model description."""
    root = ElementTree.parse(Path(__file__).parents[2] / "modelDescription" / "modelDescription.xml").getroot()
    listed = [each for each in root.iter("ScalarVariable") if each.get("causality") == "output"]
    return {each.attrib["name"]: each[0].attrib["unit"] for each in listed}


#: The outputs of the FMU in the order of its description, and their units.
UNITS = described_outputs()
OUTPUTS = tuple(UNITS)


def linear_model(p) -> LinearModel:
    """Returns the testbed as a first-order linear system, by Lagrange's equation for each of theta3 ... theta6.

    With Rayleigh's function R, it is d/dt dT/dq' + dV/dq + dR/dq' = 0. The rows of the massless shafts (theta3, theta4) give
    their rates; the rows of the carriers (theta5, theta6) give the accelerations. The torque of a sensor is minus the torque
    with which the motor turns its coupling, as in eq. (9): tau = -(dV/dtheta_motor + dR/dtheta_motor').
    """
    h_t, h_v, h_d = hessian(kinetic_energy, p), hessian(potential_energy, p), hessian(dissipation, p)
    zero = 0 * h_v[:2, :2]
    one = zero + np.eye(2, dtype=int)

    # Writes a row as the coefficients of z = (theta_motor, theta_motor', theta_shaft, theta_carrier, theta_carrier').
    def in_z(m, m_rate, s, k, k_rate):
        return np.hstack([m, m_rate, s, k, k_rate])

    shaft_rate = -inverse2(h_d[SHAFT, SHAFT]) @ in_z(
        h_v[SHAFT, MOTOR], h_d[SHAFT, MOTOR], h_v[SHAFT, SHAFT], h_v[SHAFT, CARRIER], h_d[SHAFT, CARRIER]
    )
    carrier_acceleration = -inverse2(h_t[CARRIER, CARRIER]) @ (
        in_z(
            h_v[CARRIER, MOTOR], h_d[CARRIER, MOTOR], h_v[CARRIER, SHAFT], h_v[CARRIER, CARRIER], h_d[CARRIER, CARRIER]
        )
        + h_d[CARRIER, SHAFT] @ shaft_rate
    )
    tau = -(
        in_z(h_v[MOTOR, MOTOR], h_d[MOTOR, MOTOR], h_v[MOTOR, SHAFT], h_v[MOTOR, CARRIER], h_d[MOTOR, CARRIER])
        + h_d[MOTOR, SHAFT] @ shaft_rate
    )
    x_rate = np.vstack([shaft_rate, in_z(zero, zero, zero, zero, one), carrier_acceleration])
    return LinearModel(x_rate[:, 4:], x_rate[:, :2], x_rate[:, 2:4], tau[:, 4:], tau[:, :2], tau[:, 2:4], dict(p))
