"""The aircraft as the filter believes it: the paper's nonlinear multi-point model with its Jacobian, compiled.

    x' = f(x, u)                                              (1)
    A  = df/dx                                                (5)

Wing-body and tailplane forces are separate; the tail feels the wing's downwash late. This is not JSBSim's model of the
aircraft (no stall, no actuator rate limits, its own parameters): the mismatch between the two is meant.

Source     Dickmanns & Schell 1992, section 2, eqs. (1), (5). Departs: wind is a state, so the air-relative velocity is
           u_a = u - R_BR w; the delayed downwash is carried beside the state ("shadow") and not in its covariance, since
           within a cycle of 60 ms the tail still sees the downwash of 145 ms ago.
"""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np

from landing_sim.estimators.belief import AircraftBelief
from landing_sim.geometry.so3 import from_euler
from landing_sim.jit import kernel
from landing_sim.types import Array

_NAMES = tuple(f.name for f in fields(AircraftBelief))
(
    _MASS, _IXX, _IYY, _IZZ, _IXZ, _S, _B, _C, _RHO, _G, _CLA, _A0, _CLF, _EPSA, _EPSF, _CLT, _IT, _LT, _XAC,
    _CD0, _CDF, _KV, _KI, _CM0, _CMF, _CMQ, _ZT, _CYB, _CYDR, _CYP, _CYR, _CLB, _CLDA, _CLDR, _CLP, _CLR0, _CLRL,
    _CNB, _CNDR, _CNDAL, _CNP0, _CNPL, _CNR, _TAU_EPS, _TAU_S, _TAU_E, _T0, _TV, _TVV, _TIDLE, _HW,
    _GL, _GD,
) = range(len(_NAMES))  # fmt: skip


_SLOPE = len(_NAMES)  # tangent of the runway's slope, after the aircraft's own parameters


def parameters(belief: AircraftBelief, slope: float) -> Array:
    """What the kernels are told: the aircraft, and the slope [rad] of the ground below it."""
    return np.append(belief.vector(), math.tan(slope))


@kernel
def over_ground(x: Array, par: Array) -> tuple[float, float]:
    """Height [m] of the wing above the surface and its derivative with respect to H (zero where it is held)."""
    h = x[11] - par[_SLOPE] * x[9] + par[_HW]
    return (h, 1.0) if h > 1.0 else (1.0, 0.0)


@kernel
def induced_share(h: float, par: Array) -> tuple[float, float]:
    """Share of the induced drag left at height h of the wing, and its derivative: s / (1 + s), s = (16 h / b)^2.

    Source     McCormick 1979, eq. (7.6).
    """
    k = 16.0 / par[_B]
    s = (k * h) ** 2
    return s / (1.0 + s), 2.0 * k * k * h / (1.0 + s) ** 2


@kernel
def downwash(x: Array, alpha: float, flap: float, par: Array) -> float:
    """Downwash angle at the tail [rad] once the flow has settled; the ground takes its share."""
    h2 = over_ground(x, par)[0] ** 2
    share = h2 / (h2 + par[_GD] ** 2)
    return par[_EPSA] * (alpha + par[_A0] + par[_EPSF] * flap) * share


@kernel
def dynamics(x: Array, s: Array, par: Array, f: Array, A: Array, jacobian: bool) -> None:
    """Fill f (12,) = x' and, if asked, A (12, 18) = df/d(12 states, 3 wind components, 3 offsets).

    x (>= 18,) state, layout of `states`; s (6,) shadow: elevator, aileron, rudder [rad], flap, thrust [N], downwash [rad];
    par: see `parameters`.
    """
    u, v, w, p, q, r = x[0], x[1], x[2], x[3], x[4], x[5]
    phi, theta, psi = x[6], x[7], x[8]
    de, da, dr, flap, thrust, eps = s[0], s[1], s[2], s[3], s[4], s[5]
    m, g = par[_MASS], par[_G]
    Rm = from_euler(phi, theta, psi)
    wbx = Rm[0, 0] * x[12] + Rm[1, 0] * x[13] + Rm[2, 0] * x[14]
    wby = Rm[0, 1] * x[12] + Rm[1, 1] * x[13] + Rm[2, 1] * x[14]
    wbz = Rm[0, 2] * x[12] + Rm[1, 2] * x[13] + Rm[2, 2] * x[14]
    ua, va, wa = u - wbx, v - wby, w - wbz
    uw2 = ua * ua + wa * wa
    uw = math.sqrt(uw2)
    V2 = uw2 + va * va
    V = math.sqrt(V2)
    alpha = math.atan2(wa, ua)
    beta = math.atan2(va, uw)
    ca, sa = math.cos(alpha), math.sin(alpha)
    qS = 0.5 * par[_RHO] * V2 * par[_S]
    b2V, c2V = par[_B] / (2.0 * V), par[_C] / (2.0 * V)
    wing, dwing = over_ground(x, par)
    G, dG = induced_share(wing, par)
    dG *= dwing
    lift = 1.0 / (1.0 - par[_GL] * (1.0 - G))
    dlift = -par[_GL] * lift * lift * dG

    CLw0 = par[_CLA] * (alpha + par[_A0]) + par[_CLF] * flap
    CLw = lift * CLw0
    CLt = par[_CLT] * (alpha - eps + par[_IT] + q * par[_LT] / V + de)
    CL = CLw + CLt
    k = par[_KV] + par[_KI] * G
    CD = par[_CD0] + par[_CDF] * flap + k * CLw * CLw
    CX = CL * sa - CD * ca + x[15]
    CZ = -CL * ca - CD * sa + x[16]
    CY = par[_CYB] * beta + par[_CYDR] * dr + b2V * (par[_CYP] * p + par[_CYR] * r)
    Clr = par[_CLR0] + par[_CLRL] * CLw
    Cl = par[_CLB] * beta + par[_CLDA] * da + par[_CLDR] * dr + b2V * (par[_CLP] * p + Clr * r)
    # pitch is normalised by 1 m here: chord and arms inside
    Cm = par[_XAC] * CLw - par[_LT] * CLt + par[_C] * (par[_CM0] + par[_CMF] * flap + par[_CMQ] * q * c2V + x[17])
    Cnp = par[_CNP0] + par[_CNPL] * CLw
    Cn = par[_CNB] * beta + par[_CNDR] * dr + par[_CNDAL] * CLw * da + b2V * (Cnp * p + par[_CNR] * r)

    Ixx, Iyy, Izz, Ixz = par[_IXX], par[_IYY], par[_IZZ], par[_IXZ]
    det = Ixx * Izz - Ixz * Ixz
    Lm = qS * par[_B] * Cl + (Iyy - Izz) * q * r + Ixz * p * q
    Nm = qS * par[_B] * Cn + (Ixx - Iyy) * p * q - Ixz * q * r
    Mm = qS * Cm + par[_ZT] * thrust + (Izz - Ixx) * p * r - Ixz * (p * p - r * r)

    cph, sph = math.cos(phi), math.sin(phi)
    cth, sth = math.cos(theta), math.sin(theta)
    tth = sth / cth
    f[0] = (qS * CX + thrust) / m - g * sth + r * v - q * w
    f[1] = qS * CY / m + g * cth * sph - r * u + p * w
    f[2] = qS * CZ / m + g * cth * cph + q * u - p * v
    f[3] = (Izz * Lm + Ixz * Nm) / det
    f[4] = Mm / Iyy
    f[5] = (Ixz * Lm + Ixx * Nm) / det
    qr = q * sph + r * cph
    f[6] = p + qr * tth
    f[7] = q * cph - r * sph
    f[8] = qr / cth
    f[9] = Rm[0, 0] * u + Rm[0, 1] * v + Rm[0, 2] * w
    f[10] = Rm[1, 0] * u + Rm[1, 1] * v + Rm[1, 2] * w
    f[11] = -(Rm[2, 0] * u + Rm[2, 1] * v + Rm[2, 2] * w)
    if not jacobian:
        return

    # Aerodynamics by the chain rule. Columns of d: ua, va, wa, p, q, r, H; rows: the six accelerations.
    for i in range(12):
        for j in range(18):
            A[i, j] = 0.0
    d = np.zeros((6, 7))
    d_alpha = (-wa / uw2, 0.0, ua / uw2)
    d_beta = (-ua * va / (V2 * uw), uw / V2, -wa * va / (V2 * uw))
    air = (ua, va, wa)
    bS = qS * par[_B]
    for i in range(7):
        dV_V = air[i] / V2 if i < 3 else 0.0  # dV / V
        dal = d_alpha[i] if i < 3 else 0.0
        dbe = d_beta[i] if i < 3 else 0.0
        dp = 1.0 if i == 3 else 0.0
        dq = 1.0 if i == 4 else 0.0
        dr_ = 1.0 if i == 5 else 0.0
        dCLw = lift * par[_CLA] * dal + (dlift * CLw0 if i == 6 else 0.0)
        dCLt = par[_CLT] * (dal + par[_LT] / V * (dq - q * dV_V))
        dCD = 2.0 * k * CLw * dCLw + (par[_KI] * dG * CLw * CLw if i == 6 else 0.0)
        dCL = dCLw + dCLt
        dCX = dCL * sa - dCD * ca + (CL * ca + CD * sa) * dal  # the offsets stay
        dCZ = -dCL * ca - dCD * sa + (CL * sa - CD * ca) * dal
        dp_, dr_n = b2V * (dp - p * dV_V), b2V * (dr_ - r * dV_V)
        dCY = par[_CYB] * dbe + par[_CYP] * dp_ + par[_CYR] * dr_n
        dCl = par[_CLB] * dbe + par[_CLP] * dp_ + Clr * dr_n + par[_CLRL] * dCLw * b2V * r
        dCm = par[_XAC] * dCLw - par[_LT] * dCLt + par[_C] * par[_CMQ] * c2V * (dq - q * dV_V)
        dCn = par[_CNB] * dbe + Cnp * dp_ + par[_CNR] * dr_n + dCLw * (par[_CNDAL] * da + par[_CNPL] * b2V * p)
        d[0, i] = qS / m * (dCX + 2.0 * CX * dV_V)
        d[1, i] = qS / m * (dCY + 2.0 * CY * dV_V)
        d[2, i] = qS / m * (dCZ + 2.0 * CZ * dV_V)
        dL = bS * (dCl + 2.0 * Cl * dV_V)
        dN = bS * (dCn + 2.0 * Cn * dV_V)
        d[3, i] = (Izz * dL + Ixz * dN) / det
        d[4, i] = qS / Iyy * (dCm + 2.0 * Cm * dV_V)
        d[5, i] = (Ixz * dL + Ixx * dN) / det

    # Euler rates turn the body about these axes (columns: phi, theta, psi).
    E = np.zeros((3, 3))
    E[0, 0] = 1.0
    E[1, 1], E[2, 1] = cph, -sph
    E[0, 2], E[1, 2], E[2, 2] = -sth, cth * sph, cth * cph
    for i in range(6):
        for j in range(3):
            A[i, j] = d[i, j]
            A[i, 3 + j] = d[i, 3 + j]
            # u_a = u - R_BR w, hence du_a/dw = -R_BR and du_a/dangle = omega x w_B
            A[i, 12 + j] = -(d[i, 0] * Rm[j, 0] + d[i, 1] * Rm[j, 1] + d[i, 2] * Rm[j, 2])
            ex, ey, ez = E[0, j], E[1, j], E[2, j]
            A[i, 6 + j] = (d[i, 0] * (ey * wbz - ez * wby) + d[i, 1] * (ez * wbx - ex * wbz)
                           + d[i, 2] * (ex * wby - ey * wbx))  # fmt: skip
        A[i, 11] = d[i, 6]
        A[i, 9] = -par[_SLOPE] * d[i, 6]
    A[0, 15], A[2, 16], A[4, 17] = qS / m, qS / m, qS * par[_C] / Iyy
    # gravity and transport
    A[0, 7] += -g * cth
    A[1, 6] += g * cth * cph
    A[1, 7] += -g * sth * sph
    A[2, 6] += -g * cth * sph
    A[2, 7] += -g * sth * cph
    A[0, 1] += r
    A[0, 2] += -q
    A[0, 4] += -w
    A[0, 5] += v
    A[1, 0] += -r
    A[1, 2] += p
    A[1, 3] += w
    A[1, 5] += -u
    A[2, 0] += q
    A[2, 1] += -p
    A[2, 3] += -v
    A[2, 4] += u
    # gyroscopic moments
    Lp, Lq, Lr = Ixz * q, (Iyy - Izz) * r + Ixz * p, (Iyy - Izz) * q
    Np, Nq, Nr = (Ixx - Iyy) * q, (Ixx - Iyy) * p - Ixz * r, -Ixz * q
    A[3, 3] += (Izz * Lp + Ixz * Np) / det
    A[3, 4] += (Izz * Lq + Ixz * Nq) / det
    A[3, 5] += (Izz * Lr + Ixz * Nr) / det
    A[5, 3] += (Ixz * Lp + Ixx * Np) / det
    A[5, 4] += (Ixz * Lq + Ixx * Nq) / det
    A[5, 5] += (Ixz * Lr + Ixx * Nr) / det
    A[4, 3] += ((Izz - Ixx) * r - 2.0 * Ixz * p) / Iyy
    A[4, 5] += ((Izz - Ixx) * p + 2.0 * Ixz * r) / Iyy
    # kinematics
    dqr = q * cph - r * sph
    A[6, 3], A[6, 4], A[6, 5] = 1.0, sph * tth, cph * tth
    A[6, 6], A[6, 7] = dqr * tth, qr / (cth * cth)
    A[7, 4], A[7, 5], A[7, 6] = cph, -sph, -qr
    A[8, 4], A[8, 5] = sph / cth, cph / cth
    A[8, 6], A[8, 7] = dqr / cth, qr * tth / cth
    for i in range(3):
        sign = -1.0 if i == 2 else 1.0
        for j in range(3):
            A[9 + i, j] = sign * Rm[i, j]
            ex, ey, ez = E[0, j], E[1, j], E[2, j]
            A[9 + i, 6 + j] = sign * (Rm[i, 0] * (ey * w - ez * v) + Rm[i, 1] * (ez * u - ex * w)
                                      + Rm[i, 2] * (ex * v - ey * u))  # fmt: skip


@kernel
def thrust(throttle: float, airspeed: float, par: Array) -> float:
    """Steady thrust [N] of all engines."""
    share = par[_TIDLE] + (1.0 - par[_TIDLE]) * throttle
    return par[_T0] * share * (1.0 + par[_TV] * airspeed + par[_TVV] * airspeed * airspeed)


@kernel
def propagate(x: Array, s: Array, u: Array, par: Array, on_ground: bool, dt: float, Phi: Array) -> None:
    """Advance x (>= 18,) and the shadow s (6,) in place by dt [s] under commands u, and fill Phi (18, 18).

    u (5,): elevator, aileron, rudder [rad], throttle, flap as acting on the actuators during dt.
    State by Runge-Kutta 4 (eq. 8), Phi by the matrix exponential's series to third order (eq. 6) at the start.
    On the ground the gear carries the aircraft and no such model is at hand: velocities and rates are then held, and the
    process noise (larger there) accounts for what happens.
    """
    A, rates, y = np.zeros((12, 18)), np.zeros((4, 12)), x.copy()
    V = math.sqrt((x[0] - x[12]) ** 2 + x[1] ** 2 + x[2] ** 2)  # along-wind only: enough for a thrust lapse
    s0 = s.copy()
    a_s, a_e = math.exp(-dt / par[_TAU_S]), math.exp(-dt / par[_TAU_E])
    a_d = math.exp(-dt / par[_TAU_EPS])
    for i in range(3):
        s[i] = u[i] + (s0[i] - u[i]) * a_s
    s[3] = u[4]
    T = thrust(u[3], V, par)
    s[4] = T + (s0[4] - T) * a_e
    eps = downwash(x, math.atan2(x[2], x[0]), s0[3], par)
    s[5] = eps + (s0[5] - eps) * a_d
    mid = np.empty(6)
    for i in range(6):
        mid[i] = 0.5 * (s0[i] + s[i])

    for stage in range(4):
        share = 1.0 if stage == 3 else 0.5
        for i in range(12 if stage > 0 else 0):
            y[i] = x[i] + share * dt * rates[stage - 1, i]
        dynamics(y, mid, par, rates[stage], A, stage == 0)
        for i in range(6 if on_ground else 0):
            rates[stage, i] = 0.0
    for i in range(6 if on_ground else 0):
        for j in range(18):
            A[i, j] = 0.0
    for i in range(12):
        x[i] += dt / 6.0 * (rates[0, i] + 2.0 * rates[1, i] + 2.0 * rates[2, i] + rates[3, i])

    # exp(A dt), rows of wind and offsets being zero: I + A dt (I + A dt/2 (I + A dt/3))
    n = 18
    T1 = np.zeros((12, n))
    T2 = np.zeros((12, n))
    for i in range(12):
        for j in range(n):
            T1[i, j] = A[i, j] * dt / 3.0
    for order in (2.0, 1.0):
        # T2 = (A dt/order) (I + T1)
        for i in range(12):
            for j in range(n):
                acc = A[i, j]
                for k in range(12):
                    acc += A[i, k] * T1[k, j]
                T2[i, j] = acc * dt / order
        for i in range(12):
            for j in range(n):
                T1[i, j] = T2[i, j]
    for i in range(n):
        for j in range(n):
            Phi[i, j] = (T1[i, j] if i < 12 else 0.0) + (1.0 if i == j else 0.0)
