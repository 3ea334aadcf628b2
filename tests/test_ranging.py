"""Range observers: image dynamics against exact arithmetic and differences, the contract, and where range is lost."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from landing_sim.estimators.ranging import fused
from landing_sim.estimators.ranging import perspective as p
from landing_sim.estimators.ranging.chen import ChenKano
from landing_sim.estimators.ranging.contract import (
    Flag,
    Motion,
    OffRayError,
    OffRayWarning,
    guess_on_ray,
    increments,
    motion_between,
    steady_motion,
)
from landing_sim.estimators.ranging.dahl import Dahl
from landing_sim.estimators.ranging.dixon import Dixon
from landing_sim.estimators.ranging.ekf import RangeEkf
from landing_sim.estimators.ranging.fused import Fused
from landing_sim.estimators.ranging.gains import HighGain, SuperTwisting, pole_pair
from landing_sim.estimators.ranging.gibert import Gibert, GibertDiscrete
from landing_sim.estimators.ranging.jankovic import JankovicGhosh
from landing_sim.estimators.ranging.karagiannis import Karagiannis
from landing_sim.geometry.so3 import from_euler
from landing_sim.noise import Noise
from landing_sim.papers import point_approach as approach
from landing_sim.papers.academic_example import START, A, B, course
from landing_sim.papers.courses import largest_step, observe, settling

OBSERVERS = {
    "gibert": Gibert(),
    "gibert, sliding": Gibert(SuperTwisting(L=3.0)),
    "gibert, discrete": GibertDiscrete(),
    "dahl": Dahl(),
    "karagiannis": Karagiannis(),
    "jankovic": JankovicGhosh(),
    "dixon": Dixon(),
    "chen": ChenKano(),
    "fused": Fused(1.0, 8.64, eps=1e-3, limit=math.inf),
    "ekf": RangeEkf(sigma=(0.0021, 0.0119, 1.0), first=1.5, drift=0.005),
}
every_observer = pytest.mark.parametrize("observer", OBSERVERS.values(), ids=OBSERVERS)

# --------------------------------------------------------------------------------- Psi, its Jacobian, its determinant


class Dual:
    """a + b . (eps1, eps2, eps3) with rational entries: exact derivatives of rational functions."""

    def __init__(self, value, slope=(0, 0, 0)):
        self.value, self.slope = Fraction(value), tuple(map(Fraction, slope))

    def __add__(self, other):
        other = other if isinstance(other, Dual) else Dual(other)
        return Dual(self.value + other.value, [a + b for a, b in zip(self.slope, other.slope)])

    def __neg__(self):
        return Dual(-self.value, [-a for a in self.slope])

    def __sub__(self, other):
        return self + (-other)

    def __mul__(self, other):
        other = other if isinstance(other, Dual) else Dual(other)
        return Dual(
            self.value * other.value, [a * other.value + self.value * b for a, b in zip(self.slope, other.slope)]
        )

    __rmul__ = __mul__
    __radd__ = __add__

    def __truediv__(self, other):
        inverse = Dual(1 / other.value, [-b / other.value**2 for b in other.slope])
        return self * inverse


def exact_jacobian(x, a, b, output=1, printed=False):
    """dPsi/dx as fractions: with the true derivative of the output, or with the one that (3) prints."""
    x = [Dual(value, [int(i == k) for k in range(3)]) for i, value in enumerate(x)]
    rate = [sum((a[i][k] * x[k] for k in range(3)), Dual(b[i])) for i in range(3)]
    y = [x[i] / x[2] for i in range(2)]
    i = output - 1
    y_rate = rate[i] / x[2] if printed else (rate[i] - y[i] * rate[2]) / x[2]
    rows = [y[0], y_rate, y[1]] if output == 1 else [y[0], y[1], y_rate]
    return [row.slope for row in rows]


def det3(m):
    return (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )


def rational_cases(count=25):
    """Random rationals: an identity of rational functions of this degree that holds on all of them holds."""
    drawn = iter(np.round(40 * Noise(1, "rational").normal(15 * count)).astype(int).tolist())
    for _ in range(count):
        x = [Fraction(next(drawn), 7), Fraction(next(drawn), 11), Fraction(abs(next(drawn)) + 1, 3)]
        a = [[Fraction(next(drawn), 13) for _ in range(3)] for _ in range(3)]
        yield x, a, [Fraction(next(drawn), 5) for _ in range(3)]


def test_determinant_exactly():
    for x, a, b in rational_cases():
        x3 = x[2]
        assert det3(exact_jacobian(x, a, b)) == (b[0] - b[2] * x[0] / x3) / x3**4
        assert det3(exact_jacobian(x, a, b, output=2)) == -(b[1] - b[2] * x[1] / x3) / x3**4


def test_the_printed_psi_contradicts_the_printed_condition():
    for x, a, b in rational_cases():
        assert det3(exact_jacobian(x, a, b, printed=True)) == b[0] / x[2] ** 4


@pytest.mark.parametrize("output", [1, 2])
def test_jacobian_and_determinant(output):
    for x, a, b in rational_cases():
        xf, af, bf = (np.array(v, dtype=float) for v in (x, a, b))
        exact = np.array(exact_jacobian(x, a, b, output), dtype=float)
        np.testing.assert_allclose(p.jacobian(xf, af, bf, output), exact, rtol=1e-10, atol=1e-10 * np.abs(exact).max())
        assert p.determinant(xf, bf, output) == pytest.approx(float(det3(exact_jacobian(x, a, b, output))), rel=1e-10)
    for x in course(0.5, 8.0):
        step = 1e-6
        columns = [
            (p.psi(x + step * e, A, B, output) - p.psi(x - step * e, A, B, output)) / (2 * step) for e in np.eye(3)
        ]
        numeric = np.column_stack(columns)
        assert np.abs(p.jacobian(x, A, B, output) - numeric).max() < 1e-6 * np.abs(numeric).max()


@pytest.mark.parametrize("output", [1, 2])
def test_pull_back_inverts_the_jacobian(output):
    x, kappa = np.array([1.0, 1.5, 2.5]), np.array([0.3, -0.7, 0.2])  # of y_output, its derivative, the other
    ordered = kappa if output == 1 else kappa[[2, 0, 1]]
    expected = np.linalg.solve(p.jacobian(x, A, B, output), ordered)
    np.testing.assert_allclose(p.pulled_back(x, A, B, output, *kappa, 0.01), expected, rtol=1e-12)


def test_pull_back_fades_without_a_jump():
    """Across d = 0: bounded by floor, zero at zero, and equal to the inverse at |d| = floor."""
    x, floor = np.array([1.0, 1.5, 2.5]), 0.2
    ranges = []
    for d in (1.001 * floor, 0.999 * floor, 0.01 * floor, 0.0, -0.01 * floor):
        b = np.array([d + B[2] * x[0] / x[2], B[1], B[2]])
        ranges.append(p.pulled_back(x, A, b, 1, 0.0, 0.1, 0.0, floor)[2])
    assert ranges[0] == pytest.approx(ranges[1], rel=3e-3) and ranges[0] == pytest.approx(-6.25 * 0.1 / floor, rel=2e-3)
    assert abs(ranges[2]) < 0.011 * abs(ranges[0]) and ranges[3] == 0.0 and ranges[4] == pytest.approx(-ranges[2])


def test_image_drift_against_the_exact_motion():
    x, h = START, 1e-5
    ahead, back = (motion.R @ x + motion.t for motion in (steady_motion(A, B, h), steady_motion(A, B, -h)))
    p1, p2, r3, d1, d2 = p.drift(x[0] / x[2], x[1] / x[2], A, B)
    y3 = 1.0 / x[2]
    assert (ahead[0] / ahead[2] - back[0] / back[2]) / (2 * h) == pytest.approx(p1 + d1 * y3, abs=1e-9)
    assert (ahead[1] / ahead[2] - back[1] / back[2]) / (2 * h) == pytest.approx(p2 + d2 * y3, abs=1e-9)
    assert (1 / ahead[2] - 1 / back[2]) / (2 * h) == pytest.approx(-r3 * y3 - B[2] * y3**2, abs=1e-9)


# ------------------------------------------------------------------------------------------------------------ motion


def test_a_camera_s_motion_has_minus_signs():
    """x' = -[w]x x - v of the camera's own rate and velocity: eq. (17) prints a plus before both."""
    v, w, h = np.array([2.0, -1.0, 70.0]), np.array([0.02, 0.05, -0.03]), 1e-3
    R_WC = from_euler(0.1, 0.05, -0.4)
    spin = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    after = R_WC @ steady_motion(spin, np.zeros(3), h).R
    moved = motion_between(R_WC.T, np.zeros(3), after.T, R_WC @ v * h, h)
    np.testing.assert_allclose(moved.A, -spin, atol=1e-9)
    np.testing.assert_allclose(moved.B, -v, atol=0.002)  # v turned within the step


def test_increments_are_exact_and_their_rates_have_the_same_effect():
    rng = Noise(3, "increments")
    for _ in range(5):
        R, t = from_euler(*(0.3 * rng.normal(3))).T, 5.0 * rng.normal(3)
        motion = increments(R, t, 0.04)
        assert motion.R is R and motion.t is t
        again = steady_motion(motion.A, motion.B, 0.04)
        np.testing.assert_allclose(again.R, R, atol=1e-12)
        np.testing.assert_allclose(again.t, t, atol=1e-11)


def test_the_approach_s_increments_carry_the_aim_point():
    x, moves = approach.points(approach.Approach()), approach.motions(approach.Approach())
    for k in (0, 200, 400, 1200):
        np.testing.assert_allclose(moves[k].R @ x[k] + moves[k].t, x[k + 1], atol=1e-8)


# ------------------------------------------------------------------------------------------------------------ starts

RAY = START[:2] / START[2]


def test_a_guess_on_the_ray_is_taken_as_it_is(recwarn):
    assert guess_on_ray(0.4 * START, RAY) == pytest.approx(1.0)
    assert not recwarn


def test_a_guess_beside_the_ray_is_moved_there_with_a_message():
    ray = np.array([*RAY, 1.0])
    aside = np.array([ray[1], -ray[0], 0.0])  # perpendicular to the ray
    with pytest.warns(OffRayWarning, match=r"2\.86 deg off .* depth 2"):
        depth = guess_on_ray(2.0 * ray + 0.05 * 2.0 * np.linalg.norm(ray) * aside / np.linalg.norm(aside), RAY)
    assert depth == pytest.approx(2.0)


@pytest.mark.parametrize("guess", [(1.0, 1.5, 1.0), (3.0, -1.0, 5.0), (-1.0, 0.5, 1.0), (-0.4, -0.6, -1.0)])
def test_a_guess_far_off_the_ray_is_refused(guess):
    """Started there, the published observer meets a singular Jacobian, diverges, or takes twice its time."""
    with pytest.raises(OffRayError, match="deg off the measured direction"):
        guess_on_ray(np.array(guess), RAY)


@every_observer
@pytest.mark.parametrize("depth", [0.0, -1.0, math.nan, math.inf])
def test_a_first_range_must_be_one(observer, depth):
    with pytest.raises(ValueError, match="positive and finite"):
        observer.start(RAY, depth)


@every_observer
def test_a_start_needs_a_direction(observer):
    with pytest.raises(ValueError, match="direction"):
        observer.start(np.array([math.nan, 0.1]), 1.0)


# ------------------------------------------------------------------------------------------------------ the contract


@every_observer
def test_finds_the_range_of_the_example(observer):
    x = course(0.01, 3.0)
    found = observe(observer, x, x[:, :2] / x[:, 2:], [steady_motion(A, B, 0.01)] * 300, 0.01, 1.0)
    assert settling(found) < 1.0
    assert abs(found.relative[-1]) < 0.01
    np.testing.assert_allclose(found.x_hat[-1], found.x[-1], atol=0.06)


@every_observer
def test_a_step_is_a_pure_function(observer):
    motion = steady_motion(A, B, 0.01)
    state = observer.step(observer.start(RAY, 1.0), RAY + 0.001, motion, 0.01)
    kept = (state.x.copy(), state.y.copy(), state.inner.copy())
    one, two = (observer.step(state, RAY + 0.002, motion, 0.01) for _ in range(2))
    for before, now in zip(kept, (state.x, state.y, state.inner)):
        np.testing.assert_array_equal(before, now)
    np.testing.assert_array_equal(one.x, two.x)
    np.testing.assert_array_equal(one.inner, two.inner)
    d = B[:2] - B[2] * RAY
    assert (one.d1, one.d2) == pytest.approx(tuple(d), rel=0.05)


@every_observer
def test_what_was_not_measured_is_carried_by_the_motion(observer):
    """Half a second without images in mid-course: no NaN, and the range is still right."""
    x = course(0.01, 3.0)
    y = x[:, :2] / x[:, 2:]
    y[150:200] = math.nan
    found = observe(observer, x, y, [steady_motion(A, B, 0.01)] * 300, 0.01, 1.0)
    assert np.isfinite(found.x_hat).all()
    assert (found.flag[150:200] == Flag.UNOBSERVABLE).all()
    assert np.abs(found.relative[150:200]).max() < 0.01
    assert abs(found.relative[-1]) < 0.01


# ------------------------------------------------------------------------------------------- where range is lost


def through_zero():
    """The example from 7 to 12 s, where d1 passes zero at 9.565 s, with 1 % noise every 10 ms."""
    x = course(0.01, 12.0)[700:]
    y = x[:, :2] / x[:, 2:]
    return x, y * (1.0 + 0.01 * Noise(1, "through_zero").normal(y.size).reshape(y.shape))


@every_observer
def test_passing_d1_zero(observer):
    x, y = through_zero()
    motions = [steady_motion(A, B, 0.01)] * (len(x) - 1)
    small = {"eps": 0.1} if isinstance(observer, Fused) else {"floor": 0.1}
    found = observe(replace(observer, limit=0.02, **small), x, y, motions, 0.01, float(x[0, 2]))
    assert np.isfinite(found.x_hat).all() and (found.x_hat[:, 2] > 0.0).all()
    assert largest_step(found, motions) <= 0.02 + 1e-9
    assert found.d[1:, 0].min() < -0.05 < 0.05 < found.d[1:, 0].max()  # it did pass
    if isinstance(observer, Gibert | GibertDiscrete | Dahl):  # who sees range in y1 alone
        assert (found.flag[1:][np.abs(found.d[1:, 0]) < 0.1] != Flag.GOOD).all()
    if getattr(observer, "kappa", None) == HighGain():
        assert np.abs(found.relative).max() < 0.25
    assert (found.flag[1:] == Flag.GOOD).any()


@pytest.mark.parametrize(
    "observer", [GibertDiscrete(HighGain(lambda1=50.0, lambda2=50.0)), Dahl(omega=0.1)], ids=["gibert", "dahl"]
)
def test_a_sign_that_changed_between_two_samples_is_seen(observer):
    x = course(1.0, 12.0)[8:]  # d1 is 0.42 at 8 s, 0.22 at 9 s, -0.19 at 10 s: never small
    found = observe(observer, x, x[:, :2] / x[:, 2:], [steady_motion(A, B, 1.0)] * 4, 1.0, float(x[0, 2]))
    assert np.abs(found.d[1:, 0]).min() > 0.05
    assert found.flag[1] == Flag.GOOD and found.flag[2] == Flag.UNOBSERVABLE


CIVIL = {
    "gibert, discrete": GibertDiscrete(HighGain(1.0, 0.5, 0.5), floor=3.0, limit=0.02),
    "gibert": Gibert(HighGain(1.0, 0.5, 0.5), floor=3.0, limit=0.02, longest=0.04),
    "fused": Fused(omega=0.5, eps=3.0, limit=0.02),
    "ekf": RangeEkf(floor=3.0, limit=0.02),
}


@pytest.mark.parametrize("observer", CIVIL.values(), ids=CIVIL)
@pytest.mark.parametrize("where", [approach.Approach(), approach.ON_GLIDE], ids=["intercept", "glide"])
def test_no_jump_on_an_approach(observer, where):
    """d1 changes its sign at 2 s and both vanish on the glide path: no NaN, no step above 2 %, and it is said."""
    for share in (0.5, 1.5) if where == approach.Approach() else (1.5,):
        found = approach.run(approach.Watch("", observer, share, where))[0]
        assert np.isfinite(found.x_hat).all() and (found.x_hat[:, 2] > 0.0).all()
        assert largest_step(found, approach.motions(where)) <= 0.02 + 1e-9
        assert (found.flag[np.linalg.norm(found.d, axis=1) < 1.0] != Flag.GOOD).all()
        if where == approach.Approach():
            assert (found.flag == Flag.GOOD).any()


@pytest.mark.parametrize("name", ["gibert, discrete", "gibert", "fused"])
@pytest.mark.parametrize("share", [0.5, 1.5])
def test_half_the_range_wrong_is_found_on_intercept(name, share):
    found = approach.run(approach.Watch("", CIVIL[name], share))[0]
    assert settling(found, until=30.0) < 16.0


def test_on_the_glide_path_only_a_width_tells_the_range():
    at = round(30.0 / approach.PERIOD)
    aim = approach.run(approach.Watch("", CIVIL["fused"], 1.5, approach.ON_GLIDE))[0]
    assert aim.relative[at] > 0.5
    for observer in (Fused(omega=0.3, eps=0.05, floors=(3.0, 3.0, 0.0)), RangeEkf()):
        errors = []
        for share in (0.5, 1.5):
            for seen in approach.run(approach.Watch("", observer, share, approach.ON_GLIDE, width=45.0, repeats=3)):
                errors.append(seen.relative[at])
        assert np.abs(errors).max() < 0.06


def test_an_underestimate_that_is_not_corrected_does_not_run_through_zero():
    motion = steady_motion(np.zeros((3, 3)), np.array([0.0, 0.0, -70.0]), 0.04)
    for observer in CIVIL.values():
        state = observer.start(np.zeros(2), 10.0)
        for _ in range(10):
            state = observer.step(state, np.zeros(2), motion, 0.04)
        assert state.x[2] > 0.0 and state.flag != Flag.GOOD


# ------------------------------------------------------------------------------------------------ gains and updates


@pytest.mark.parametrize("xi", [0.7, 0.99, 1.0, 1.5])
@pytest.mark.parametrize("dt", [0.001, 0.04])
def test_discrete_gains_put_the_poles_where_the_continuous_ones_are(xi, dt):
    omega = 7.0
    l1, l2 = pole_pair(xi, omega, dt)
    after = (np.eye(2) - np.outer([l1, l2], [1.0, 0.0])) @ np.array([[1.0, dt], [0.0, 1.0]])
    wanted = np.exp(np.roots([1.0, 2.0 * xi * omega, omega**2]) * dt)
    # a double pole is only found to the root of the precision: compare the polynomial instead
    np.testing.assert_allclose(np.poly(after), np.real(np.poly(wanted)), atol=1e-12)


def test_a_correction_by_hand():
    z, e, d = np.array([0.1, 0.2, 0.01]), np.array([1e-3, -2e-3, 5e-4]), np.array([4.0, 3.0, 0.5])
    found = fused.correct(z, 1e-3, e, d, np.array([1.0, 0.5, 2.0]), (0.1, 0.02), 2.0)
    power = 16.0 + 0.5 * 9.0 + 2.0 * 0.25
    assert found.rho == pytest.approx(1e-3 + 0.02 * (4e-3 - 3e-3 + 5e-4) / (power + 4.0))
    np.testing.assert_allclose(found.z, z + 0.1 * e)
    assert found.observed == pytest.approx(math.sqrt(power)) and not found.limited


def test_what_was_not_measured_does_not_correct():
    z, d, w = np.array([0.1, 0.2]), np.array([4.0, 3.0]), np.ones(2)
    both = fused.correct(z, 1e-3, np.array([1e-3, math.nan]), d, w, (0.1, 0.02), 2.0)
    one = fused.correct(z[:1], 1e-3, np.array([1e-3]), d[:1], w[:1], (0.1, 0.02), 2.0)
    assert both.rho == one.rho and both.z[1] == z[1]


@pytest.mark.parametrize("eps", [0.0, 3.0])
def test_nothing_moves_nothing_is_corrected(eps):
    found = fused.correct(np.zeros(2), 1e-3, np.array([1e-3, 1e-3]), np.zeros(2), np.ones(2), (0.1, 0.02), eps)
    assert found.rho == 1e-3 and found.observed == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_correction_is_cut(sign):
    found = fused.correct(np.zeros(1), 1e-3, np.array([sign]), np.ones(1), np.ones(1), (0.1, 0.02), 0.1, 0.02)
    assert found.limited
    ratio = (1.0 / found.rho) / 1000.0
    assert abs(ratio - 1.0) <= 0.02 + 1e-12 and ratio == pytest.approx(1.0 / 1.02 if sign > 0 else 1.02)


def test_faded_weights():
    weights = fused.faded(np.ones(3), np.array([3.0, 0.0, 0.6]), np.array([3.0, 3.0, 0.0]))
    np.testing.assert_allclose(weights, [0.5, 0.0, 1.0])


def test_one_output_is_gibert_s():
    """With one weight and no eps, rho moves as eq. (10) moves it by kappa's second entry."""
    x, e, gains = np.array([1.0, 1.5, 2.5]), 0.01, pole_pair(1.0, 7.0, 0.01)
    d = B[:2] - B[2] * x[:2] / x[2]
    rho = fused.correct(x[:2] / x[2], 1.0 / x[2], np.array([e, e]), d, np.array([1.0, 0.0]), gains, 0.0).rho
    moved = p.pulled_back(x, A, B, 1, 0.0, gains[1] * e, 0.0, 0.05)[2]
    assert rho - 1.0 / x[2] == pytest.approx(-moved / x[2] ** 2, rel=1e-12)


def test_a_width_joins_when_it_is_first_measured():
    motion = steady_motion(np.zeros((3, 3)), np.array([0.0, 0.0, -70.0]), 0.04)
    observer = Fused(eps=0.05)
    state = observer.start(np.array([0.01, 0.02, math.nan]), 3000.0)
    state = observer.step(state, np.array([0.01, 0.02, math.nan]), motion, 0.04)
    assert np.isfinite(state.x).all()
    state = observer.step(state, np.array([0.01, 0.02, 0.015]), motion, 0.04)
    assert state.inner[0] == pytest.approx(0.015)


def test_an_ekf_says_how_sure_it_is():
    """Errors over their one sigma on the approach, 10 seeds: neither proud nor shy."""
    observer = RangeEkf(drift=0.02)
    ratios = []
    where = approach.Approach()
    x, moves = approach.points(where)[:500], approach.motions(where)
    for seed in range(10):
        noise = Noise(seed, "ekf").normal(2 * len(x)).reshape(-1, 2)
        y = x[:, :2] / x[:, 2:] + approach.PIXEL * noise
        state = observer.start(y[0], 1.5 * x[0, 2])
        for measured, motion in zip(y[1:], moves):
            state = observer.step(state, measured, motion, approach.PERIOD)
        ratios.append((state.x[2] - x[-1, 2]) / observer.sigmas(state)[2])
    assert 0.4 < np.sqrt(np.mean(np.square(ratios))) < 1.8


def test_an_ekf_s_update_is_that_of_information():
    observer, still = RangeEkf(sigma=(1e-3, 2e-3, 3e-3), drift=0.0), steady_motion(np.zeros((3, 3)), np.zeros(3), 1.0)
    y = np.array([0.1, -0.05, 0.015])
    before = observer.start(y, 1000.0)
    P = before.inner[1:].reshape(4, 4)
    H = np.array([[1e-3, 0, -1e-4, 0], [0, 1e-3, 5e-5, 0], [0, 0, -1.5e-5, 1e-3]])
    after = observer.step(before, y, still, 1.0)
    P = P + 1e-9 * np.eye(4)  # the start is certain across the ray to the last digit
    wanted = np.linalg.inv(np.linalg.inv(P) + H.T @ np.diag(1.0 / np.square(observer.sigma)) @ H)
    np.testing.assert_allclose(after.inner[1:].reshape(4, 4), wanted, rtol=1e-4, atol=1e-6 * np.abs(wanted).max())
    assert observer.sigmas(after) == pytest.approx(np.sqrt(np.diag(wanted)), rel=1e-4)


def test_an_ekf_starts_when_all_is_measured():
    with pytest.raises(ValueError, match="3 outputs"):
        RangeEkf().start(np.array([0.0, 0.0, math.nan]), 1000.0)


def test_sliding_mode_with_the_true_sign_chatters():
    """Why the boundary layer is there: sampled, a relay with a delay never rests."""
    x = course(0.01, 4.0)
    spread = []
    for layer in (1e-3, 1e-12):
        observer = Gibert(SuperTwisting(L=3.0, layer=layer), longest=0.01)
        found = observe(observer, x, x[:, :2] / x[:, 2:], [steady_motion(A, B, 0.01)] * 400, 0.01, 1.0)
        spread.append(float(np.abs(found.relative[200:]).max()))
    assert spread[0] < 0.01 < spread[1]


def test_motion_is_a_value():
    motion = steady_motion(A, B, 0.1)
    assert isinstance(motion, Motion)
    with pytest.raises(AttributeError):
        motion.A = A  # type: ignore[misc]
