"""Winds of the campaigns, each against its formula: profiles, discrete gusts, microburst, turbulence of both kinds."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import welch

from landing_sim.errors import ScenarioError, dotted
from landing_sim.missions import onboard, runway_landing, truth
from landing_sim.noise import Noise
from landing_sim.scenario import load
from landing_sim.vehicle import load as load_vehicle
from landing_sim.world.dryden import DrydenTurbulence, Turbulence, low_altitude, spectrum_1797, spectrum_8785c
from landing_sim.world.first_order import FirstOrder, FirstOrderTurbulence
from landing_sim.world.gusts import DiscreteGust, MetDiscreteGust
from landing_sim.world.microburst import RADIUS_OF_MAXIMUM, Microburst
from landing_sim.world.shear import AT_33FT, CertificationWind, LogWind, certification_shear, log_law
from landing_sim.world.wind import SteadyWind, Wind, WindConfig

FOOT = 0.3048


# ------------------------------------------------------------------------------------------------------------ profiles


def test_log_law_of_the_standard() -> None:
    """W20 ln(h/z0)/ln(20/z0), z0 = 0.15 ft: 1 at 20 ft, 1.329 at 100 ft, 0.612 up to 3 ft, kept from 1,000 ft on."""
    shares = [log_law(h * FOOT, 20 * FOOT, 0.15 * FOOT) for h in (20.0, 100.0, 3.0, 0.0, -5.0, 1000.0, 5000.0)]
    np.testing.assert_allclose(shares, [1.0, 1.32894, 0.61227, 0.61227, 0.61227, 1.79954, 1.79954], atol=1e-5)


def test_certification_shear_is_in_feet() -> None:
    """1.0 at 33 ft, and the landing challenge's "about 1.6" at 300 m; 0.35 at 1 ft and below."""
    assert certification_shear(AT_33FT) == pytest.approx(1.0, abs=0.005)
    assert certification_shear(300.0) == pytest.approx(1.637, abs=0.001)
    assert certification_shear(1000 * FOOT) == pytest.approx(0.43 * 3 + 0.35)
    assert certification_shear(-2.0) == certification_shear(FOOT) == pytest.approx(0.35)


def test_profiles_keep_direction_and_signs() -> None:
    """On the nose is -x, to the right +y, at the reference height as given."""
    np.testing.assert_allclose(LogWind(10.0, -3.0).velocity(0, 0, 0, AT_33FT, 70), (-10.0, -3.0, 0.0))
    np.testing.assert_allclose(CertificationWind(10.0, -3.0).velocity(0, 0, 0, AT_33FT, 70), (-10, -3, 0), rtol=0.005)
    for part in (LogWind(10.0, -3.0), CertificationWind(10.0, -3.0)):
        wx, wy, wz = part.velocity(0.0, 0.0, 0.0, 120.0, 70.0)
        assert (wx / wy, wz) == (pytest.approx(10.0 / 3.0), 0.0)
        assert wx < -10.0


@settings(deadline=None)
@given(low=st.floats(-10, 400), more=st.floats(0, 400))
def test_wind_never_falls_with_height(low: float, more: float) -> None:
    assert certification_shear(low + more) >= certification_shear(low) > 0
    assert log_law(low + more, AT_33FT, 0.05) >= log_law(low, AT_33FT, 0.05) > 0


def test_height_is_above_the_runway() -> None:
    """On a runway that climbs 2 % the ground is 8 m up after 400 m; before the threshold it is level."""
    wind = Wind(WindConfig(steady=CertificationWind(10.0)), slope=0.02)
    assert wind.wind(0.0, 400.0, 0.0, 8.0 + AT_33FT, 70.0)[0] == pytest.approx(-10.0, rel=0.005)
    assert wind.wind(0.0, -400.0, 0.0, AT_33FT, 70.0)[0] == pytest.approx(-10.0, rel=0.005)


# --------------------------------------------------------------------------------------------------------------- gusts


def _through(gust: DiscreteGust, *, airspeed: float = 50.0, dt: float = 0.005, ground: float = 40.0, n: int = 4000):
    part = MetDiscreteGust(gust)
    return np.array([part.velocity(k * dt, -1000 + ground * k * dt, 0.0, 50.0, airspeed) for k in range(n)])


@pytest.mark.parametrize("shape", ["pulse", "ramp"])
def test_one_minus_cosine(shape: str) -> None:
    """U/2 (1 - cos(pi s/H)) of the distance flown through the air, which in a headwind is more than over the ground."""
    gust = DiscreteGust(at_x=-900.0, headwind=4.0, lateral=-3.0, vertical=2.0, gradient=60.0, shape=shape)
    found = _through(gust)
    t = 0.005 * np.arange(len(found))
    s = 50.0 * (t - t[500] - 0.005)  # met at the first step past -900 m, which 40 m/s reach at 2.5 s
    wanted = 0.5 * (1 - np.cos(np.pi * s / 60.0))
    wanted[s < 0] = 0.0
    wanted[s > (120.0 if shape == "pulse" else 60.0)] = 0.0 if shape == "pulse" else 1.0
    np.testing.assert_allclose(found, wanted[:, None] * [-4.0, -3.0, -2.0], atol=1e-9)
    assert np.abs(found[:, 1]).max() == pytest.approx(3.0, abs=1e-3)


def test_discrete_gust_does_not_start_again() -> None:
    part = MetDiscreteGust(DiscreteGust(at_x=0.0, lateral=1.0))
    assert part.velocity(5.0, -1.0, 0.0, 9.0, 50.0) == (0.0, 0.0, 0.0)
    part.velocity(6.0, 1.0, 0.0, 9.0, 50.0)
    with pytest.raises(ValueError, match="time went back"):
        part.velocity(0.0, -1.0, 0.0, 9.0, 50.0)


# ---------------------------------------------------------------------------------------------------------- microburst

BURST = Microburst(x=-1500.0, y=300.0, radius=600.0, outflow=20.0, outflow_height=50.0)


def _at(burst: Microburst, x: float, y: float, z: float) -> np.ndarray:
    return np.array(burst.velocity(0.0, x, y, z, 70.0))


@settings(deadline=None)
@given(x=st.floats(-4000, 1000), y=st.floats(-2500, 2500), z=st.floats(2, 600))
def test_microburst_conserves_mass(x: float, y: float, z: float) -> None:
    """The divergence, by central differences, is nothing beside the gradients that it is the sum of."""
    d = 0.05
    parts = []
    for axis in range(3):
        step = d * np.eye(3)[axis]
        up, down = _at(BURST, *(np.array([x, y, z]) + step)), _at(BURST, *(np.array([x, y, z]) - step))
        parts.append((up[axis] - down[axis]) / (2 * d) * (-1 if axis == 2 else 1))  # z is up here, the wind's z down
    assert abs(sum(parts)) < 1e-6 + 1e-6 * max(map(abs, parts))


def test_microburst_formula() -> None:
    """Oseguera and Bowles' u_r and u_z, written out in cylinder coordinates as they give them."""
    upper, lower = 50.0 / 0.22, 50.0 / 2.75
    rate = 20.0 / (0.2357 * 600.0)  # the paper's rounded scale: 0.3 % agrees
    for r, angle, z in itertools.product((1.0, 400.0, 900.0, 3000.0), (0.0, 2.0), (5.0, 50.0, 400.0)):
        wind = _at(BURST, -1500.0 + r * math.cos(angle), 300.0 + r * math.sin(angle), z)
        fade = math.exp(-((r / 600.0) ** 2))
        u_r = rate * 600.0**2 / (2 * r) * (1 - fade) * (math.exp(-z / upper) - math.exp(-z / lower))
        u_z = -rate * fade * (lower * (math.exp(-z / lower) - 1) - upper * (math.exp(-z / upper) - 1))
        wanted = [u_r * math.cos(angle), u_r * math.sin(angle), -u_z]
        np.testing.assert_allclose(wind, wanted, rtol=3e-3, atol=1e-12)


def test_microburst_is_as_strong_as_asked_where_it_says() -> None:
    r, z = np.meshgrid(np.linspace(1, 2000, 400), np.linspace(0.5, 300, 300))
    out = np.array([_at(BURST, -1500.0 + a, 300.0, b)[0] for a, b in zip(r.ravel(), z.ravel())])
    k = np.argmax(out)
    assert out[k] == pytest.approx(20.0, rel=1e-3)
    assert r.ravel()[k] == pytest.approx(600.0 * RADIUS_OF_MAXIMUM, abs=6)
    assert z.ravel()[k] == pytest.approx(50.0, rel=0.02)


def test_microburst_blows_outward_and_down_and_nowhere_into_the_ground() -> None:
    assert _at(BURST, -2000.0, 300.0, 50.0)[0] < 0 < _at(BURST, -1000.0, 300.0, 50.0)[0]  # headwind, then tailwind
    assert _at(BURST, -1500.0, 700.0, 50.0)[1] > 0
    assert _at(BURST, -1500.0, 300.0, 200.0)[2] > 0  # falling air
    np.testing.assert_array_equal(_at(BURST, -1500.0, 300.0, 200.0)[:2], 0.0)
    np.testing.assert_array_equal(_at(BURST, -1400.0, 300.0, 0.0)[2], 0.0)
    np.testing.assert_array_equal(_at(BURST, -1400.0, 300.0, -3.0), _at(BURST, -1400.0, 300.0, 0.0))


# ---------------------------------------------------------------------------------------------------------- turbulence


def _psd_ratio(samples: np.ndarray, dt: float, formula, segments: int, length: int) -> None:
    """Averaged periodograms against a one-sided spectrum in rad/s, folded at the sampling rate, band by band."""
    f, found = welch(samples, 1 / dt, nperseg=length, noverlap=0)
    folds = (f[:, None] + np.arange(-300, 301) / dt) * 2 * np.pi
    wanted = formula(np.abs(folds)).sum(axis=1) * 2 * np.pi
    edges = np.unique(np.geomspace(2, length // 2, 12).astype(int))
    for lo, hi in itertools.pairwise(edges):
        ratio = np.mean(found[lo:hi] / wanted[lo:hi])
        # a Hann window makes a bin share 1.94 times its variance with its neighbours
        assert abs(ratio - 1) < 4 * math.sqrt(1.94 / (segments * (hi - lo))), (f[lo], f[hi], ratio)


def test_first_order_spectrum() -> None:
    segments, length, dt = 48, 4096, 0.02
    config = FirstOrder(sigma_level=3.0, sigma_vertical=0.77)
    part = FirstOrderTurbulence(config, Noise(1, "turbulence"))
    samples = np.array([part.velocity(k * dt, 0.0, 0.0, 50.0, 70.0) for k in range(segments * length)])
    for axis, (sigma, T) in enumerate(((3.0, 2.5), (3.0, 2.5), (0.77, 0.125))):

        def formula(w: np.ndarray, sigma: float = sigma, T: float = T) -> np.ndarray:
            return sigma**2 * 2 * T / np.pi / (1 + (T * w) ** 2)

        _psd_ratio(samples[:, axis], dt, formula, segments, length)
    assert np.abs(np.corrcoef(samples[::50].T) - np.eye(3)).max() < 0.15


def test_first_order_does_not_depend_on_the_step() -> None:
    """Correlation over 0.1 s, from steps of 0.005 and of 0.1 s; the variance is there from the first sample."""
    for dt in (0.005, 0.1):
        n, lag = 100_000, round(0.1 / dt)
        part = FirstOrderTurbulence(FirstOrder(2.0, 0.5), Noise(2, "turbulence"))
        samples = np.array([part.velocity(k * dt, 0.0, 0.0, 50.0, 70.0) for k in range(n)])
        for axis, (sigma, T) in enumerate(((2.0, 2.5), (2.0, 2.5), (0.5, 0.125))):
            wanted = math.exp(-0.1 / T)
            moved = samples[lag:, axis] - wanted * samples[:-lag, axis]
            assert np.mean(moved**2) / sigma**2 == pytest.approx(1 - wanted**2, rel=4 * math.sqrt(2 * lag / n))
    first = [FirstOrderTurbulence(FirstOrder(2.0, 0.5), Noise(k, "t")).velocity(0, 0, 0, 9, 70) for k in range(2000)]
    np.testing.assert_allclose(np.var(first, axis=0), [4.0, 4.0, 0.25], rtol=4 * math.sqrt(2 / 2000))


def test_the_challenges_gains_make_unit_variance_of_its_noise() -> None:
    """10/(2.5 s + 1) and 2.25/(0.125 s + 1) on noise held for 0.05 s, stepped finely: what FirstOrder's sigmas rest on."""
    ours = FirstOrder(1.0)
    for gain, T, wanted in ((10.0, ours.time_level, 1.0), (2.25, ours.time_vertical, 1.0125)):
        assert gain**2 * 0.05 / (2 * T) == pytest.approx(wanted, abs=1e-3)
    assert ours.sigma_vertical == pytest.approx(1.5 * 1852 / 3600, abs=2e-3)


def test_the_two_dryden_standards_describe_the_same_air() -> None:
    """Lv and Lw halved, spectra of twice the length: written as each standard writes it, equal to rounding."""
    for height, V in ((10.0, 60.0), (80.0, 75.0), (250.0, 90.0)):
        w = np.geomspace(1e-3, 100, 50)
        for a, b in zip(spectrum_8785c(w, height, 9.0, V), spectrum_1797(w, height, 9.0, V)):
            np.testing.assert_allclose(a, b, rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spectrum_of_1797(axis: int) -> None:
    segments, length, dt, V, height = 32, 4096, 0.02, 60.0, 40.0
    part = DrydenTurbulence(Turbulence(10.0), Noise(7, "turbulence"))
    samples = np.array([part.velocity(k * dt, 0.0, 0.0, height, V)[axis] for k in range(segments * length)])
    _psd_ratio(samples, dt, lambda w: spectrum_1797(w, height, 10.0, V)[axis], segments, length)


def test_spectra_integrate_to_the_variance() -> None:
    sigma_uv, sigma_w, *_ = low_altitude(60.0, 10.0)
    w = np.geomspace(1e-6, 1e5, 200_000)
    for spectrum in (spectrum_8785c, spectrum_1797):
        found = [np.trapezoid(phi, w) for phi in spectrum(w, 60.0, 10.0, 70.0)]
        np.testing.assert_allclose(found, [sigma_uv**2, sigma_uv**2, sigma_w**2], rtol=1e-3)


# --------------------------------------------------------------------------------------------------------- all together


def _everything() -> Wind:
    config = WindConfig(
        steady=CertificationWind(5.0, 3.0),
        discrete=DiscreteGust(at_x=-800.0, lateral=4.0),
        microburst=BURST,
        turbulence=FirstOrder(1.5),
    )
    return Wind(config, Noise(4, "turbulence"))


@settings(max_examples=10, deadline=None)
@given(start=st.floats(-3000, 0), y=st.floats(-500, 500), height=st.floats(-2, 400))
def test_parts_add(start: float, y: float, height: float) -> None:
    whole = _everything()
    parts = (
        CertificationWind(5.0, 3.0),
        MetDiscreteGust(DiscreteGust(at_x=-800.0, lateral=4.0)),
        BURST,
        FirstOrderTurbulence(FirstOrder(1.5), Noise(4, "turbulence")),
    )
    for k in range(200):
        here = (0.005 * k, start + 0.35 * k, y, height, 70.0)
        np.testing.assert_allclose(whole.wind(*here), np.sum([p.velocity(*here) for p in parts], axis=0), atol=1e-12)


def test_the_same_seed_gives_the_same_bits() -> None:
    def fly() -> bytes:
        wind = _everything()
        return np.array([wind.wind(0.005 * k, -2000 + 0.35 * k, 5.0, 90.0, 70.0) for k in range(3000)]).tobytes()

    assert fly() == fly()


@pytest.mark.parametrize(
    "make",
    [
        lambda: LogWind(math.nan),
        lambda: LogWind(1.0, roughness=0.0),
        lambda: LogWind(1.0, reference_height=1.0, roughness=2.0),
        lambda: CertificationWind(crosswind=math.inf),
        lambda: DiscreteGust(at_x=math.nan),
        lambda: DiscreteGust(at_x=0.0, gradient=0.0),
        lambda: DiscreteGust(at_x=0.0, shape="square"),
        lambda: Microburst(0.0, radius=0.0),
        lambda: Microburst(0.0, outflow=-1.0),
        lambda: Microburst(math.inf),
        lambda: FirstOrder(-1.0),
        lambda: FirstOrder(1.0, time_vertical=0.0),
        lambda: FirstOrder(math.nan),
        lambda: Wind(WindConfig(turbulence=FirstOrder(1.0))),
        lambda: Wind(WindConfig(steady=SteadyWind()), slope=math.nan),
    ],
)
def test_bad_settings_are_refused(make) -> None:
    with pytest.raises(ValueError, match=r"[Ww]ind|gust|microburst|turbulence"):
        make()


# ------------------------------------------------------------------------------------------------------- in a scenario

KINDS = {
    "logarithmic": ("wind.headwind_mps=6", "wind.profile={law: logarithmic}"),
    "certification": ("wind.headwind_mps=6", "wind.crosswind_mps=2", "wind.profile={law: certification}"),
    "discrete": ("wind.discrete_gust={at_x_m: -900, lateral_mps: 4, gradient_m: 60, shape: ramp}",),
    "microburst": ("wind.microburst={x_m: -600, y_m: 200, radius_m: 500, outflow_mps: 5}",),
    "first_order": ("wind.headwind_mps=6", "wind.turbulence={model: first_order}"),
    "dryden_1797": ("wind.turbulence={model: dryden_1797, severity: light}",),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_flown_in(kind: str) -> None:
    """What the plant reports as its wind is the formula's, at the aircraft, all through the first seconds of a flight."""
    scenario = load("do128/calm", KINDS[kind])
    wind = truth.wind(scenario, Noise(scenario.seed, "turbulence"))
    steps = runway_landing.build(scenario, load_vehicle("do128"), scenario.seed).steps()
    before, moved = None, 0.0
    start = scenario.initial
    wind.wind(0.0, start.x_m, start.y_m, start.height_m, 50.0)
    for step, _ in zip(steps, range(40)):
        now = step.truth
        if before is not None:
            # the plant was last told one step before `now`; steps of its own in between move nothing but turbulence
            for k in range(12):
                share = k / 12
                p = before.p_RB + share * (now.p_RB - before.p_RB)
                told = wind.wind(before.t + 0.005 * k, p[0], p[1], -p[2], now.airspeed)
            np.testing.assert_allclose(now.wind_R, told, atol=0.02)
            moved = max(moved, float(np.abs(told).max()))
        before = now
    assert moved > 0.5


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        (("wind.turbulence={model: first_order, severity: light}",), "wind.turbulence.severity"),
        (("wind.turbulence={model: first_order, wind_at_20ft_mps: 3}",), "wind.turbulence.wind_at_20ft_mps"),
        (("wind.turbulence={severity: light, wind_at_33ft_mps: 3}",), "wind.turbulence.wind_at_33ft_mps"),
        (("wind.turbulence={model: dryden_1797}",), "wind.turbulence"),
        (("wind.profile={law: certification, roughness_m: 0.1}",), "wind.profile.roughness_m"),
        (("wind.profile={law: logarithmic, roughness_m: 20}",), "wind.profile.roughness_m"),
        (("wind.profile={law: logarithmic}", "wind.crosswind_from_x_m=-800"), "wind.crosswind_from_x_m"),
        (("wind.microburst={x_m: 0, radius_m: 10}",), "wind.microburst.radius_m"),
        (("wind.discrete_gust={lateral_mps: 3}",), "wind.discrete_gust.at_x_m"),
        (("wind.profile={law: powerlaw}",), "wind.profile.law"),
    ],
)
def test_winds_that_do_not_fit_are_refused(changes: tuple[str, ...], place: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load("do128/calm", changes)
    assert place in [dotted(problem.location) for problem in caught.value.problems]


def test_the_filter_is_told_how_strong_the_turbulence_is() -> None:
    """As the Dryden wind at 20 ft of the same strength; 0.77 m/s vertically alone are those of 7.7 m/s."""

    def told(*changes: str) -> float:
        return onboard._reported_turbulence(load("do128/calm", changes))

    assert told() == 0.0
    assert told("wind.turbulence={severity: light}") == told("wind.turbulence={model: dryden_1797, severity: light}")
    assert told("wind.turbulence={model: first_order}") == pytest.approx(7.7)
    assert told("wind.turbulence={model: first_order, wind_at_33ft_mps: 20}") == pytest.approx(
        3.0 / low_altitude(100 * FOOT, 1.0)[0]
    )
    head_and_cross = ("wind.headwind_mps=12", "wind.crosswind_mps=16", "wind.turbulence={model: first_order}")
    assert told(*head_and_cross) == told("wind.turbulence={model: first_order, wind_at_33ft_mps: 20}")
    assert told(*head_and_cross, "wind.profile={law: certification}") == pytest.approx(told(*head_and_cross), rel=0.01)
    assert told(*head_and_cross, "believed.turbulence_mps=1") == 1.0
