"""Linear-quadratic feedback with a prescribed eigenstructure: pure functions on (A, B).

Two steps. First a gain K_d that gives x' = (A - B K_d) x the eigenvalues asked for, each with the eigenvector nearest to
the one asked for that two or so actuators can produce. Then an LQ problem that follows that loop:

    J = int (u + K_d x)' R1 (u + K_d x) + rho (x' Q0 x + u' R u) dt

rho = 0 returns K_d with whatever robustness it has; rho -> inf the plain LQ regulator of (Q0, R); in between the
prescribed modes are kept nearly, and margins are bought where they cost least.

Source     Dickmanns & Schell 1992, section 6, names the method and cites Otto 1990, which could not be obtained: this is
           a reconstruction from Moore 1976 (the subspace of eigenvectors that can be had), Andry, Shapiro & Chung 1983
           (projection onto it) and implicit model following (Tyler 1964, Kreindler & Rothschild 1976).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import null_space, solve_continuous_are

from landing_sim.types import Array


class DesignError(ValueError):
    """A controller that cannot be designed as asked; the message says what to change."""


@dataclass(frozen=True, slots=True)
class Mode:
    """One mode that is asked for: an eigenvalue (of a pair, the one with the positive imaginary part) and its shape.

    `shape` names the components of the eigenvector that matter and their wanted ratios; components not named are free.
    With m inputs, m components can be met exactly and more only nearly.
    """

    name: str
    eigenvalue: complex  # [1/s]
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def order(self) -> int:
        return 1 if self.eigenvalue.imag == 0.0 else 2


@dataclass(frozen=True, slots=True)
class Achieved:
    """What became of a mode in a closed loop. `vector` is scaled so that its largest wanted component is as wanted."""

    name: str
    wanted: complex
    eigenvalue: complex
    vector: np.ndarray  # (n,) complex, in the units of the states
    shape_error: float  # distance of the wanted components from the wanted shape, in scaled states, relative to it


@dataclass(frozen=True, slots=True)
class Solution:
    """An LQ gain with its Riccati matrix. `residual` is that of the Riccati equation, relative to its largest term."""

    K: Array  # (m, n), u = -K x
    P: Array  # (n, n)
    residual: float


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """How far a loop, broken at one actuator with the others closed or at all alike ("all"), is from instability."""

    loop: str
    gain_up: float  # factor, > 1
    gain_down: float  # factor, < 1; 0 if no reduction destabilises
    phase: float  # [rad]
    delay: float  # [s] more than is already in the loop
    crossover: float  # [rad/s] highest frequency with unit gain


@dataclass(frozen=True, slots=True)
class Margins:
    """Robustness at the actuators."""

    stable: bool  # with the delay and lags given
    max_sensitivity: float  # largest singular value of (I + L)^-1 over frequency, inputs scaled; 1 is ideal
    loops: tuple[LoopMargins, ...]


def prescribed_gain(A: Array, B: Array, modes: Sequence[Mode], names: Sequence[str], scale: Array) -> Array:
    """K_d (m, n) with u = -K_d x: eigenvalues as in `modes`, eigenvectors as near as they can be had.

    The eigenvectors of A - B K for the eigenvalue s are those v = N z with [A - s I, B] [N; M] = 0; the one nearest in
    the named components is taken, and K_d = -W V^-1 with w = M z.

    Parameters
    ----------
    A, B : (n, n), (n, m) of x' = A x + B u
    names : (n,) names of the states, as used by the shapes
    scale : (n,) typical sizes of the states, in which nearness is measured

    Raises     DesignError if the modes do not add up to n states, if one cannot be controlled, or if two shapes are
               nearly parallel
    Source     Moore 1976; Andry, Shapiro & Chung 1983, section III
    """
    n, m = B.shape
    if sum(mode.order for mode in modes) != n:
        raise DesignError(f"the modes {[mode.name for mode in modes]} make {sum(m.order for m in modes)} of {n} states")
    V, W = np.empty((n, n)), np.empty((m, n))
    column = 0
    for mode in modes:
        basis = null_space(np.hstack([_scaled(A, scale) - mode.eigenvalue * np.eye(n), B / scale[:, None]]))
        if basis.shape[1] != m:
            raise DesignError(f"mode {mode.name!r}: {mode.eigenvalue} is an eigenvalue that the inputs cannot move")
        rows, wanted = _wanted(mode, names, scale)
        z = np.linalg.lstsq(basis[rows], wanted.astype(complex), rcond=None)[0]
        vector = basis @ z
        vector /= np.linalg.norm(vector[:n])
        parts = (vector.real,) if mode.order == 1 else (vector.real, vector.imag)
        for part in parts:
            V[:, column], W[:, column] = part[:n], part[n:]
            column += 1
    condition = np.linalg.cond(V)
    if condition > 1e7:
        raise DesignError(f"the mode shapes are nearly dependent (condition {condition:.0e}): ask for other shapes")
    return -np.linalg.solve(V.T, W.T).T / scale


def follow(A: Array, B: Array, K_d: Array, R1: Array, Q0: Array, R: Array, rho: float) -> Solution:
    """The LQ gain that follows the loop of K_d (module docstring), weights R1 (m, m), Q0 (n, n), R (m, m), rho >= 0.

    Raises     DesignError if the Riccati equation has no stabilising solution
    """
    if rho < 0.0 or not np.isfinite(rho):
        raise DesignError(f"rho must be 0 or more, not {rho}")
    Q = K_d.T @ R1 @ K_d + rho * Q0
    N = K_d.T @ R1
    G = R1 + rho * R
    if rho == 0.0:
        # Q = N G^-1 N': the Hamiltonian has the mirror images of A - B K_d only, P = 0 exactly where that is stable.
        P = np.zeros_like(A)
    else:
        try:
            P = solve_continuous_are(A, B, Q, G, s=N)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise DesignError(f"the Riccati equation has no stabilising solution ({error})") from error
    terms = (A.T @ P, P @ A, Q, (P @ B + N) @ np.linalg.solve(G, B.T @ P + N.T))
    residual = np.abs(terms[0] + terms[1] + terms[2] - terms[3]).max() / max(np.abs(t).max() for t in terms)
    K = np.linalg.solve(G, B.T @ P + N.T)
    if np.linalg.eigvals(A - B @ K).real.max() >= 0.0:
        raise DesignError("the closed loop is not stable: ask for eigenvalues with negative real parts")
    return Solution(np.asarray(K, np.float64), P, float(residual))


def achieved(
    A: Array, B: Array, K: Array, modes: Sequence[Mode], names: Sequence[str], scale: Array
) -> tuple[Achieved, ...]:
    """The modes of A - B K, each paired with the mode asked for that it is nearest to in eigenvalue and shape."""
    from scipy.optimize import linear_sum_assignment  # a tenth of a second that no flight needs

    values, vectors = np.linalg.eig(A - B @ K)
    vectors = vectors / scale[:, None]
    slots = [(mode, s) for mode in modes for s in ((mode.eigenvalue, mode.eigenvalue.conjugate())[: mode.order])]
    fits = [[_fit(mode, names, scale, v) for v in vectors.T] for mode, _ in slots]
    cost = np.array([[abs(value - s) / abs(s) + fit[1] for value, fit in zip(values, row)]
                     for (_, s), row in zip(slots, fits)])  # fmt: skip
    _, column = linear_sum_assignment(cost)
    found = []
    for i, (mode, s) in enumerate(slots):
        if s == mode.eigenvalue:
            k = int(column[i])
            factor, error = fits[i][k]
            found.append(Achieved(mode.name, s, complex(values[k]), factor * vectors[:, k] * scale, error))
    return tuple(found)


def _fit(mode: Mode, names: Sequence[str], scale: Array, vector: np.ndarray) -> tuple[complex, float]:
    """The factor that brings a scaled eigenvector nearest to the wanted shape, and what is left, relative to it."""
    rows, wanted = _wanted(mode, names, scale)
    if not rows.size:
        return complex(1.0 / vector[np.argmax(np.abs(vector))]), 0.0
    part = vector[rows]
    factor = complex(np.vdot(part, wanted) / max(np.vdot(part, part).real, 1e-30))
    return factor, float(np.linalg.norm(factor * part - wanted) / np.linalg.norm(wanted))


def margins(
    A: Array,
    B: Array,
    K: Array,
    delay: float,
    lags: Sequence[float],
    inputs: Sequence[str],
    input_scale: Array,
) -> Margins:
    """Margins of the loop u = -K x with a delay [s] and a first-order lag [s] in each actuator, by frequency sweep.

    L(jw) = K (jw I - A)^-1 B, rows multiplied by exp(-jw delay) / (1 + jw lag). With the other loops closed, actuator i
    sees l_i = det(I + L) / det(I + L without row and column i) - 1; a change made alike in all loops moves the
    eigenvalues of L.
    """
    n, m = B.shape
    w = np.geomspace(1e-3, 300.0, 6000)
    actuator = np.exp(-1j * w * delay)[:, None] / (1.0 + 1j * w[:, None] * np.asarray(lags))
    L = K @ np.linalg.solve(1j * w[:, None, None] * np.eye(n) - A, np.broadcast_to(B.astype(complex), (w.size, n, m)))
    L = actuator[:, :, None] * L
    whole = np.linalg.det(np.eye(m) + L)
    scaled = L / input_scale[:, None] * input_scale
    sensitivity = np.linalg.svd(np.linalg.inv(np.eye(m) + scaled), compute_uv=False)[:, 0].max()
    loops = []
    for i, name in enumerate(inputs):
        keep = [j for j in range(m) if j != i]
        others = np.linalg.det(np.eye(m - 1) + L[:, keep][:, :, keep])
        loops.append(_scalar_margins(name, w, (whole / others - 1.0)[:, None]))
    loops.append(_scalar_margins("all", w, _tracked_eigenvalues(L)))
    stable = bool(loop_poles(A, B, K, delay, lags).real.max() < 0.0)
    return Margins(stable, float(sensitivity), tuple(loops))


def loop_poles(A: Array, B: Array, K: Array, delay: float, lags: Sequence[float]) -> np.ndarray:
    """Poles of the closed loop with actuator lags [s] and a delay [s] as a third-order Padé approximation."""
    n, m = B.shape
    F, G, H = A, B, np.eye(n)  # the chain so far: x' = F x + G u, seen as H x
    for i, lag in enumerate(lags):
        if lag > 0.0:
            F, G, H = _in_series(F, G, H, i, np.array([[-1.0 / lag]]), np.array([1.0 / lag]), np.array([1.0]), 0.0)
    if delay > 0.0:
        h = delay  # companion form of (120 - 60 hs + 12 h2s2 - h3s3) / (120 + 60 hs + 12 h2s2 + h3s3)
        a = np.array([120.0 / h**3, 60.0 / h**2, 12.0 / h])
        pade = np.vstack([np.eye(3)[1:], -a])
        c = np.array([2.0 * a[0], 0.0, 2.0 * a[2]])
        for i in range(m):
            F, G, H = _in_series(F, G, H, i, pade, np.array([0.0, 0.0, 1.0]), c, -1.0)
    return np.linalg.eigvals(F - G @ K @ H)


def _in_series(F: Array, G: Array, H: Array, i: int, a: Array, b: Array, c: Array, d: float) -> tuple[Array, ...]:
    """The system (F, G, H) with the scalar filter (a, b, c, d) put before its input i."""
    n, k = F.shape[0], a.shape[0]
    F_new = np.block([[F, np.outer(G[:, i], c)], [np.zeros((k, n)), a]])
    G_new = np.vstack([G, np.zeros((k, G.shape[1]))])
    G_new[:n, i] *= d
    G_new[n:, i] = b
    return F_new, G_new, np.hstack([H, np.zeros((H.shape[0], k))])


def _scaled(A: Array, scale: Array) -> Array:
    return A / scale[:, None] * scale


def _wanted(mode: Mode, names: Sequence[str], scale: Array) -> tuple[np.ndarray, Array]:
    """Rows and values of the named components, in scaled states."""
    unknown = [key for key in mode.shape if key not in names]
    if unknown:
        raise DesignError(f"mode {mode.name!r}: no state {unknown[0]!r} among {list(names)}")
    rows = np.array([names.index(key) for key in mode.shape], dtype=np.int64)
    values = np.array(list(mode.shape.values()), dtype=float)
    if rows.size and not values.any():
        raise DesignError(f"mode {mode.name!r}: at least one component of the shape must not be zero")
    return rows, values / scale[rows]


def _tracked_eigenvalues(L: np.ndarray) -> np.ndarray:
    """Eigenvalues of L (k, m, m), each column one continuous branch."""
    from scipy.optimize import linear_sum_assignment

    branches = np.linalg.eigvals(L)
    for k in range(1, len(branches)):
        cost = np.abs(branches[k - 1][:, None] - branches[k][None, :])
        branches[k] = branches[k][linear_sum_assignment(cost)[1]]
    return branches


def _scalar_margins(name: str, w: Array, branches: np.ndarray) -> LoopMargins:
    """Margins of scalar loops (k, branches) sampled at w; the worst over the branches."""
    up, down, phase, delay, crossover = np.inf, 0.0, np.pi, np.inf, 0.0
    for l in branches.T:
        size = np.abs(l)
        for k in np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0):
            part = (1.0 - size[k]) / (size[k + 1] - size[k])
            here, at = l[k] + part * (l[k + 1] - l[k]), w[k] + part * (w[k + 1] - w[k])
            lead = float(np.angle(-here))  # above the negative real axis, 0 at -1
            phase, crossover = min(phase, abs(lead)), max(crossover, at)
            delay = min(delay, (lead % (2.0 * np.pi)) / at)
        for k in np.flatnonzero((l.imag[:-1] * l.imag[1:] < 0.0) & (l.real[:-1] < 0.0)):
            part = l.imag[k] / (l.imag[k] - l.imag[k + 1])
            factor = -1.0 / (l.real[k] + part * (l.real[k + 1] - l.real[k]))
            up, down = (min(up, factor), down) if factor > 1.0 else (up, max(down, factor))
    return LoopMargins(name, up, down, phase, delay, crossover)
