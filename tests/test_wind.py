"""Wind: hand-computed gusts, and Dryden turbulence against the standard's figures and spectra."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from landing_sim.noise import Noise
from landing_sim.world.dryden import KNOT, W20, DrydenTurbulence, Turbulence, _transverse, low_altitude
from landing_sim.world.wind import CrosswindStep, ExponentialGust, SteadyWind, Wind, WindConfig

PAPER = WindConfig(step=CrosswindStep(), gust=ExponentialGust())


def test_steady_signs() -> None:
    """A headwind is air moving towards -x; a positive crosswind moves towards +y."""
    wind = Wind(WindConfig(SteadyWind(headwind=5.0, crosswind=-2.0)))
    np.testing.assert_array_equal(wind.wind(0.0, -950.0, 0.0, 51.0, 50.0), [-5.0, -2.0, 0.0])


def test_step_and_gust_of_the_paper() -> None:
    """-1 m/s beyond -800 m; at -650 m -2 m/s lateral and 1 m/s upward (z is down) are added, gone to 1/e in 6 s."""
    wind = Wind(PAPER)
    np.testing.assert_array_equal(wind.wind(0.0, -950.0, 0.0, 51.0, 50.0), [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(wind.wind(3.0, -800.0, 0.0, 45.0, 50.0), [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(wind.wind(3.005, -799.75, 0.0, 45.0, 50.0), [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(wind.wind(6.0, -650.0, 0.0, 38.0, 50.0), [0.0, -1.0, 0.0])
    np.testing.assert_array_equal(wind.wind(6.005, -649.75, 0.0, 38.0, 50.0), [0.0, -3.0, -1.0])
    np.testing.assert_allclose(
        wind.wind(12.005, -350.0, 0.0, 20.0, 50.0), [0.0, -1.7357588823, -0.3678794412], rtol=1e-9
    )


def test_gust_goes_on_wherever_the_aircraft_goes_then() -> None:
    wind = Wind(WindConfig(gust=ExponentialGust(at_x=-650.0, lateral=-2.0, vertical=0.0, tau=6.0)))
    wind.wind(6.0, -649.0, 0.0, 38.0, 50.0)
    np.testing.assert_allclose(wind.wind(12.0, -900.0, 0.0, 38.0, 50.0), [0.0, -2.0 * math.exp(-1.0), 0.0])


def test_a_gust_once_met_does_not_start_again() -> None:
    """A Wind flown a second time would otherwise blow harder than ever."""
    wind = Wind(PAPER)
    wind.wind(6.0, -649.0, 0.0, 38.0, 50.0)
    with pytest.raises(ValueError, match="time went back"):
        wind.wind(0.0, -950.0, 0.0, 51.0, 50.0)


def test_gust_meets_at_once_who_starts_beyond_it() -> None:
    np.testing.assert_array_equal(Wind(PAPER).wind(0.0, -500.0, 0.0, 30.0, 50.0), [0.0, -3.0, -1.0])


def test_softened_step() -> None:
    step = CrosswindStep(at_x=-800.0, crosswind=4.0, over=40.0)
    at = [step.velocity(0.0, x, 0.0, 45.0, 50.0)[1] for x in (-800.0, -790.0, -780.0, -770.0, -760.0, 0.0)]
    np.testing.assert_allclose(at, [0.0, 0.5857864376, 2.0, 3.4142135624, 4.0, 4.0], rtol=1e-9)


def test_parts_add_and_each_answer_is_its_own() -> None:
    config = WindConfig(SteadyWind(3.0, 1.0), CrosswindStep(), ExponentialGust(), Turbulence(5.0))
    parts = (
        WindConfig(steady=config.steady),
        WindConfig(step=config.step),
        WindConfig(gust=config.gust),
        WindConfig(turbulence=config.turbulence),
    )
    whole, split = Wind(config, Noise(3, "turbulence")), [Wind(part, Noise(3, "turbulence")) for part in parts]
    kept = []
    for k in range(2000):
        here = (0.005 * k, -900.0 + 0.25 * k, 0.0, 50.0 - 0.01 * k, 50.0)
        kept.append(whole.wind(*here))
        np.testing.assert_allclose(kept[-1], np.sum([part.wind(*here) for part in split], axis=0), rtol=0, atol=1e-12)
    assert len(set(kept)) == 2000


@pytest.mark.parametrize(
    "make",
    [
        lambda: SteadyWind(headwind=math.nan),
        lambda: CrosswindStep(over=-1.0),
        lambda: CrosswindStep(at_x=math.inf),
        lambda: ExponentialGust(tau=0.0),
        lambda: ExponentialGust(lateral=math.inf),
        lambda: Turbulence(-1.0),
        lambda: Turbulence(math.nan),
        lambda: Wind(WindConfig(turbulence=Turbulence(5.0))),
    ],
)
def test_bad_settings_are_refused(make) -> None:
    with pytest.raises(ValueError, match=r"wind|gust|step|turbulence"):
        make()


# ------------------------------------------------------------------------------------------------------- turbulence


def test_low_altitude_figures() -> None:
    """MIL-F-8785C at 100 ft, 30 kt: worked by hand from L = h / (0.177 + 0.000823 h)^1.2 and its companions."""
    sigma_uv, sigma_w, L_uv, L_w = low_altitude(30.48, 30.0 * KNOT)
    assert sigma_w == pytest.approx(1.54333, abs=1e-5)
    assert sigma_uv == pytest.approx(2.6481, abs=1e-3)
    assert L_uv == pytest.approx(153.98, abs=0.02)
    assert L_w == pytest.approx(30.48)


def test_low_altitude_ends() -> None:
    """At 1,000 ft the model is isotropic; outside 10..1,000 ft its ends are kept."""
    top = low_altitude(304.8, 10.0)
    np.testing.assert_allclose(top, [1.0, 1.0, 304.8, 304.8])
    assert low_altitude(2000.0, 10.0) == top
    assert low_altitude(-0.5, 10.0) == low_altitude(3.048, 10.0)
    assert low_altitude(3.1, 10.0)[3] > 3.048


def test_named_intensities() -> None:
    assert [W20[name] for name in ("light", "moderate", "severe")] == pytest.approx([7.7167, 15.4333, 23.15], abs=1e-3)


def _fly(config: Turbulence, n: int, dt: float, height: float = 50.0, seed: int = 1) -> np.ndarray:
    gust = DrydenTurbulence(config, Noise(seed, "turbulence"))
    return np.array([gust.velocity(k * dt, 0.0, 0.0, height, 50.0) for k in range(n)])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spectrum(axis: int) -> None:
    """Averaged periodograms, band by band, against the standard's formula folded at the sampling rate."""
    from scipy.signal import welch

    dt, V, h, w20, segments, length = 0.02, 50.0, 50.0, 10.0, 64, 4096
    f, found = welch(_fly(Turbulence(w20), segments * length, dt)[:, axis], 1 / dt, nperseg=length, noverlap=0)

    base = 0.177 + 0.000823 * h / 0.3048
    L = h if axis == 2 else h / base**1.2
    sigma = 0.1 * w20 if axis == 2 else 0.1 * w20 / base**0.4

    def formula(Omega: np.ndarray) -> np.ndarray:
        if axis == 0:
            return sigma**2 * 2 * L / np.pi / (1 + (L * Omega) ** 2)
        return sigma**2 * L / np.pi * (1 + 3 * (L * Omega) ** 2) / (1 + (L * Omega) ** 2) ** 2

    folds = (f[:, None] + np.arange(-500, 501) / dt) * 2 * np.pi / V
    wanted = formula(np.abs(folds)).sum(axis=1) * 2 * np.pi / V
    edges = np.unique(np.geomspace(2, length // 2, 12).astype(int))
    for lo, hi in itertools.pairwise(edges):
        ratio = np.mean(found[lo:hi] / wanted[lo:hi])
        # a Hann window makes a bin share 1.94 times its variance with its neighbours
        assert abs(ratio - 1) < 4 * math.sqrt(1.94 / (segments * (hi - lo))), (f[lo], f[hi], ratio)


def test_variance() -> None:
    """Samples 1,000 s apart are independent, and have the variance of their height."""
    n = 20_000
    for height in (3.0, 60.0):
        sigma_uv, sigma_w, _, _ = low_altitude(height, 10.0)
        samples = _fly(Turbulence(10.0), n, 1000.0, height)
        np.testing.assert_allclose(
            samples.var(axis=0) / [sigma_uv**2, sigma_uv**2, sigma_w**2], 1, atol=4 * (2 / n) ** 0.5
        )
        assert np.abs(np.corrcoef(samples.T) - np.eye(3)).max() < 4 / n**0.5


@pytest.mark.parametrize("dt", [0.005, 0.05, 0.25])
def test_correlation_is_that_of_the_process_at_any_step(dt: float) -> None:
    """Over 0.25 s: exp(-a) for u, exp(-a) (1 - a / 2) for v and w, a = V 0.25 / L, whatever the step."""
    n, lag = 200_000, round(0.25 / dt)
    samples = _fly(Turbulence(10.0), n, dt, height=30.0, seed=5)
    _, _, L_uv, L_w = low_altitude(30.0, 10.0)
    for axis, L in enumerate((L_uv, L_uv, L_w)):
        a = 50.0 * 0.25 / L
        wanted = math.exp(-a) * (1.0 if axis == 0 else 1 - a / 2)
        moved = samples[lag:, axis] - wanted * samples[:-lag, axis]
        # what the past does not explain has the variance 1 - wanted^2, its mean square known to 4 sigma
        sigma = low_altitude(30.0, 10.0)[1 if axis == 2 else 0]
        assert np.mean(moved**2) / sigma**2 == pytest.approx(1 - wanted**2, rel=4 * math.sqrt(2 * lag / n))


def _step_matrices(r: float) -> tuple[np.ndarray, np.ndarray]:
    """F and Q of the transverse filter, found by exciting it with unit states and unit normals."""
    columns = []
    for excitation in np.eye(4):
        state = excitation[:2].copy()
        _transverse(state, 0, r, excitation[2], excitation[3])
        columns.append(state)
    F, G = np.array(columns[:2]).T, np.array(columns[2:]).T
    return F, G @ G.T


@settings(deadline=None)  # the first call compiles
@given(r=st.floats(1e-5, 20.0))
def test_discretisation_is_exact(r: float) -> None:
    """Two steps of r are one of 2 r, in mean and in covariance; the stationary covariance stays what it is."""
    F, Q = _step_matrices(r)
    F2, Q2 = _step_matrices(2 * r)
    P = np.array([[1.0, 0.5], [0.5, 0.5]])
    np.testing.assert_allclose(F @ F, F2, atol=1e-14)
    np.testing.assert_allclose(F @ Q @ F.T + Q, Q2, atol=1e-14)
    np.testing.assert_allclose(F @ P @ F.T + Q, P, atol=1e-14)


def test_same_seed_same_bits_and_strength_scales() -> None:
    a, b = _fly(Turbulence(5.0), 3000, 0.005), _fly(Turbulence(5.0), 3000, 0.005)
    assert a.tobytes() == b.tobytes()
    np.testing.assert_allclose(_fly(Turbulence(10.0), 3000, 0.005), 2 * a, rtol=1e-12)
    assert not np.allclose(_fly(Turbulence(5.0), 3000, 0.005, seed=2), a)


def test_time() -> None:
    """The same time gives the same gust and uses no noise; time does not run backwards."""
    once, twice = (DrydenTurbulence(Turbulence(5.0), Noise(1, "turbulence")) for _ in range(2))
    for k in range(50):
        a = once.velocity(0.005 * k, 0.0, 0.0, 50.0, 50.0)
        assert twice.velocity(0.005 * k, 0.0, 0.0, 50.0, 50.0) == a
        assert twice.velocity(0.005 * k, 0.0, 0.0, 50.0, 50.0) == a
    with pytest.raises(ValueError, match="time went back"):
        once.velocity(0.2, 0.0, 0.0, 50.0, 50.0)


def test_standing_still_freezes_the_gust() -> None:
    """Taylor's frozen field: without airspeed nothing changes."""
    gust = DrydenTurbulence(Turbulence(5.0), Noise(1, "turbulence"))
    first = gust.velocity(0.0, 0.0, 0.0, 50.0, 0.0)
    assert gust.velocity(10.0, 0.0, 0.0, 50.0, 0.0) == pytest.approx(first, rel=1e-12)
    assert max(abs(c) for c in first) > 0.0


@settings(max_examples=50, deadline=None)
@given(
    height=st.floats(-5, 3000), airspeed=st.floats(0, 300), dt=st.floats(1e-4, 10), w20=st.floats(0, 30),
    seed=st.integers(0, 5),
)  # fmt: skip
def test_gusts_stay_within_reason(height: float, airspeed: float, dt: float, w20: float, seed: int) -> None:
    gust = DrydenTurbulence(Turbulence(w20), Noise(seed, "turbulence"))
    for k in range(20):
        for c in gust.velocity(k * dt, 0.0, 0.0, height, airspeed):
            assert abs(c) <= 7 * 0.2 * w20  # 0.2 w20 > sigma at any height
