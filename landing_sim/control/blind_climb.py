"""Away from an approach that has never seen its runway, by gyros and airspeed alone, under full power."""

from __future__ import annotations

from collections.abc import Sequence

from landing_sim.control.believed import Believed

PITCH = 0.1  # [rad] wanted at first, over the approach's: from 3 deg down to 3 deg up
PER_SPEED, PER_DISTANCE = 0.005, 0.0004  # [rad] of it per m/s of airspeed too high, and per m of its integral
MOST = 0.3  # [rad] by these two


def climb(
    row: Sequence[float], V: float, b: Believed, e_V: float, int_V: float, dt: float
) -> tuple[float, float, float, float]:
    """elevator, aileron, rudder [rad] and the next int_V [m].

    row : what is scheduled at the airspeed V [m/s], as landing_lq has it; its gains on what the gyros tell are used
    b : reckoned, see estimators/reckoning.py: p q r, the bank, and pitch and w from the trim that the approach began in
    e_V : [m/s] airspeed too high

    The pitch wanted is what holds the airspeed: nothing else tells how steep it climbs, and the pitch reckoned drifts.
    """
    _, ke_w, ke_q, ke_th, *_, ka_p, ka_r, ka_ph, _, _, _, kr_p, kr_r, kr_ph, _, _ = row[:26]
    elevator0 = row[27]
    int_V = min(max(int_V + e_V * dt, -MOST / PER_DISTANCE), MOST / PER_DISTANCE)
    pitch = PITCH + min(max(PER_SPEED * e_V + PER_DISTANCE * int_V, -MOST), MOST)
    per_q = 1.0 / (V * V)
    elevator = elevator0 - per_q * (ke_w * b.w + ke_q * b.q + ke_th * (b.theta - pitch))
    aileron = -per_q * (ka_p * b.p + ka_r * b.r + ka_ph * b.phi)
    rudder = -per_q * (kr_p * b.p + kr_r * b.r + kr_ph * b.phi)
    return elevator, aileron, rudder, int_V
