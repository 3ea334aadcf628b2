"""What the filter takes the aircraft to be: the parameters of `aircraft_model`, section `believed` of vehicle.yaml."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from landing_sim.noise import NoiseStream
from landing_sim.types import Array

_STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}  # for vehicle.py, which builds it with pydantic


@dataclass(frozen=True, slots=True)
class AircraftBelief:
    """Parameters of the filter's aircraft. SI, radians, coefficients referred to S (and b or c); rates as pb/2V, qc/2V.

    alpha is measured from the body x axis; elevator > 0 nose down, aileron > 0 right wing down, rudder > 0 nose left.
    """

    __pydantic_config__ = _STRICT

    mass: float = 4000.0
    Ixx: float = 15100.0
    Iyy: float = 16900.0
    Izz: float = 29100.0
    Ixz: float = 1200.0
    S: float = 29.0
    b: float = 15.55
    c: float = 1.90
    rho: float = 1.225
    g: float = 9.81
    CL_alpha: float = 4.80  # wing-body
    alpha_0: float = 0.0908  # incidence minus zero-lift angle
    CL_flap: float = 0.90
    eps_alpha: float = 0.34  # downwash gradient
    eps_flap: float = 0.1875  # flap's share, as an angle of attack
    CLt_alpha: float = 0.963  # tail lift slope, referred to S
    i_tail: float = 0.070
    l_tail: float = 6.8
    x_ac: float = 0.228  # wing-body aerodynamic centre ahead of the cg
    CD_0: float = 0.040
    CD_flap: float = 0.090
    k_viscous: float = 0.0127  # drag due to lift that the ground does not change
    k_induced: float = 0.0382  # that it does
    Cm_0: float = -0.03
    Cm_flap: float = -0.10
    Cm_q: float = -3.0  # wing-body alone
    z_thrust: float = 0.45  # thrust line below the cg
    CY_beta: float = -0.60
    CY_rudder: float = 0.15
    CY_p: float = -0.15
    CY_r: float = 0.40
    Cl_beta: float = -0.085
    Cl_aileron: float = 0.15
    Cl_rudder: float = 0.015
    Cl_p: float = -0.50
    Cl_r0: float = 0.04
    Cl_rL: float = 0.20
    Cn_beta: float = 0.10
    Cn_rudder: float = -0.10
    Cn_ailL: float = -0.01
    Cn_p0: float = -0.01
    Cn_pL: float = -0.07
    Cn_r: float = -0.18
    tau_downwash: float = 0.145
    tau_surface: float = 0.08
    tau_engine: float = 0.7
    T_0: float = 16000.0  # both engines, static
    T_V: float = -0.0113  # T = T_0 throttle (1 + T_V V + T_VV V^2)
    T_VV: float = 4.4e-5
    T_idle: float = 0.0  # share of full thrust at throttle 0
    h_wing: float = 0.0  # [m] height of the wing above the cg
    ground_lift: float = 0.183  # wing lift is divided by 1 - this (1 - G), G the share of induced drag left
    ground_downwash: float = 3.11  # [m] height at which half of the downwash is left

    def vector(self) -> Array:
        """All parameters as one array, in the order of the fields, for the kernels."""
        return np.array(astuple(self))

    def aerodynamic(self) -> tuple[str, ...]:
        """Names of derivatives and inertias, which are known less well than the mass."""
        names = (f.name for f in fields(self))
        return tuple(n for n in names if n.startswith(("C", "eps_", "k_", "I")) and n != "CL_flap")

    def perturbed(self, noise: NoiseStream, aero_sigma: float, mass_sigma: float) -> AircraftBelief:
        """A belief that is off: derivatives and inertias by `aero_sigma`, mass and lift offset by `mass_sigma` (1 sigma,
        relative), each drawn independently. Geometry, air density, thrust map and lags stay."""
        aero = self.aerodynamic()
        draws = noise.normal(len(aero) + 2)
        changes = {n: getattr(self, n) * (1.0 + aero_sigma * d) for n, d in zip(aero, draws)}
        changes["mass"] = self.mass * (1.0 + mass_sigma * draws[-2])
        changes["CL_flap"] = self.CL_flap * (1.0 + mass_sigma * draws[-1])
        return replace(self, **changes)
