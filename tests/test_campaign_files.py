"""Campaign files: distributions, what is drawn from them, and that everything wrong is said with its place."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from landing_sim import paths, scenario
from landing_sim.campaign import file
from landing_sim.campaign.dispersions import draw, normals
from landing_sim.campaign.distributions import Distribution, quantile
from landing_sim.campaign.figures import figures
from landing_sim.campaign.landing import scenario_of
from landing_sim.campaign.plan import Campaign, Plan
from landing_sim.campaign.units import FACTORS, factor
from landing_sim.noise import Noise

HEAD = "schema_version: 1\nscenario: do128/gust\n"


def load(tmp_path: Path, text: str, runs: int | None = None) -> Plan:
    path = tmp_path / "c.yaml"
    path.write_text(HEAD + text)
    return file.load(path, runs)


def problems(tmp_path: Path, text: str) -> list[str]:
    with pytest.raises(file.CampaignError) as caught:
        load(tmp_path, text)
    return [line.removeprefix(f"{tmp_path}/") for line in str(caught.value).splitlines()]


WRONG = {
    "misspelt path": (
        "dispersions:\n  wind.croswind_mps: {normal: {mean: 0, sd: 1}}\n",
        r"c.yaml:4:3: wind.croswind_mps: unknown key \(did you mean 'crosswind_mps'\?\)",
    ),
    "misspelt set": ("set: {wind.headwind_kt: 3}\n", r"c.yaml:3:7: wind.headwind_kt: unknown key .*'headwind_mps'"),
    "no path": ("set:\n  wind..x: 3\n", r"c.yaml:4:3: set.wind..x: is not a path of keys"),
    "path through a number": ("set: {time.step_s.x: 3}\n", r"c.yaml:3:7: time.step_s: must be a valid number"),
    "bad unit": (
        "dispersions:\n  wind.crosswind_mps:\n    normal: {mean: 0, sd: 7, unit: knots}\n",
        r"c.yaml:5:36: dispersions.wind.crosswind_mps.normal.unit: must be 'mps', 'kt', .*, not 'knots'",
    ),
    "unit of another kind": (
        "dispersions: {aircraft.mass_kg: {uniform: {low: 4, high: 4.3, unit: ft}}}\n",
        r"c.yaml:3:\d+: dispersions.aircraft.mass_kg.uniform.unit: must be 'kg', 't', 'lb', not 'ft'",
    ),
    "unit of nothing": (
        "variables: {gustiness: {uniform: {low: 0, high: 1, unit: ft}}}\n",
        r"c.yaml:3:\d+: variables.gustiness.uniform.unit: 'gustiness' ends in no unit",
    ),
    "negative sd": (
        "dispersions:\n  wind.crosswind_mps: {normal: {mean: 0, sd: -1}}\n",
        r"c.yaml:4:46: dispersions.wind.crosswind_mps.normal.sd: must be greater than 0, not -1",
    ),
    "limits crossed": (
        "dispersions:\n  wind.crosswind_mps: {uniform: {low: 2, high: 1}}\n",
        r"c.yaml:4:33: dispersions.wind.crosswind_mps.uniform: low = 2 must be below high = 1",
    ),
    "nothing left": (
        "dispersions: {wind.crosswind_mps: {truncated_normal: {mean: 0, sd: 1, low: 7, high: 9}}}\n",
        r"c.yaml:3:\d+: .*truncated_normal: low ... high lies 6 or more sd beside the mean",
    ),
    "weights": (
        "dispersions: {wind.crosswind_mps: {table: {bins: [[0, 1, 0], [1, 2, 0]]}}}\n",
        r"c.yaml:3:\d+: .*table: all weights are 0",
    ),
    "bins overlap": (
        "dispersions: {wind.crosswind_mps: {table: {bins: [[0, 2, 1], [1, 2, 1]]}}}\n",
        r"c.yaml:3:\d+: .*table: bins overlap",
    ),
    "choice": (
        "dispersions: {filter.kind: {choice: {values: [augmented, split], weights: [1]}}}\n",
        r"c.yaml:3:\d+: .*choice: 1 weights for 2 values",
    ),
    "a word that is none": (
        "dispersions: {filter.kind: {choice: {values: [augmented, splitt]}}}\n",
        r"c.yaml:3:15: filter.kind: must be 'augmented'.* not 'splitt' \(did you mean 'split'\?\)",
    ),
    "two kinds": (
        "dispersions: {wind.crosswind_mps: {normal: {mean: 0, sd: 1}, uniform: {low: 0, high: 1}}}\n",
        r"c.yaml:3:\d+: .*needs exactly one of normal, .*, not normal and uniform",
    ),
    "no kind": ("dispersions: {wind.crosswind_mps: {}}\n", r"c.yaml:3:\d+: .*needs exactly one of .* not none"),
    "unknown kind": (
        "dispersions: {wind.crosswind_mps: {norml: {mean: 0, sd: 1}}}\n",
        r"c.yaml:3:36: .*norml: unknown key \(did you mean 'normal'\?\)",
    ),
    "reaches beyond": (
        "dispersions:\n  runway.slope_percent: {normal: {mean: 0, sd: 0.4}}\n",
        r"c.yaml:4:3: runway.slope_percent: must be greater than or equal to -2, not -3.2: limit what is drawn",
    ),
    "whole numbers": (
        "dispersions: {camera.width_px: {uniform: {low: 400, high: 600}}}\n",
        r"c.yaml:3:15: camera.width_px: must be a valid integer",
    ),
    "derived of nothing": (
        "variables: {w: {uniform: {low: 0, high: 1}}}\ndispersions: {wind.crosswind_mps: {derived: {of: v}}}\n",
        r"c.yaml:4:\d+: dispersions.wind.crosswind_mps.derived.of: nothing above is called 'v'",
    ),
    "correlation": (
        "dispersions:\n  wind.crosswind_mps: {normal: {mean: 0, sd: 1}}\n  wind.headwind_mps: {normal: {mean: 0, sd: 1}}\n"
        "correlations:\n  - {of: [wind.crosswind_mps, wind.headwind_mps], matrix: [[1, 1], [1, 1]]}\n",
        r"c.yaml:7:5: correlations.0: no values have such correlations",
    ),
    "correlation of nothing": (
        "correlations:\n  - {of: [a, b], matrix: [[1, 0], [0, 1]]}\n",
        r"c.yaml:4:10: correlations.0.of: nothing that is drawn is called 'a'",
    ),
    "scenario": ("risks: []\nscenario: do128/gusty\n", r"c.yaml:4:1: scenario: duplicate key"),
    "metric": (
        "risks: [{name: a, metric: sink_rate, above: 3, probability: 0.1}]\n",
        r"c.yaml:3:27: risks.0.metric: no such metric \(did you mean 'sink_rate_mps'\?\)",
    ),
    "risk without limit": (
        "risks: [{name: a, metric: sink_rate_mps, probability: 0.1}]\n",
        r"c.yaml:3:9: risks.0: needs above, below or both",
    ),
    "sure risk": (
        "risks: [{name: a, metric: sink_rate_mps, above: 3, probability: 1}]\n",
        r"c.yaml:3:\d+: risks.0.probability: must be less than 1",
    ),
    "sweep aims beside": (
        "sweep: {path: wind.crosswind_mps, values: [1, 2], aim: 3}\n",
        r"c.yaml:3:56: sweep.aim: is none of values = 1, 2",
    ),
    "sweep beyond": (
        "sweep: {path: wind.crosswind_mps, values: [10, 99], unit: kt}\n",
        r"c.yaml:3:15: wind.crosswind_mps: must be less than or equal to 30",
    ),
    "sweep of what is derived": (
        "variables: {a: {uniform: {low: 0, high: 1}}}\ndispersions: {wind.crosswind_mps: {derived: {of: a}}}\n"
        "sweep: {path: wind.crosswind_mps, values: [1]}\n",
        r"c.yaml:5:15: sweep.path: is set or derived as well",
    ),
    "set and dispersed": (
        "set: {wind.crosswind_mps: 1}\ndispersions: {wind.crosswind_mps: {normal: {mean: 0, sd: 1}}}\n",
        r"c.yaml:4:35: dispersions.wind.crosswind_mps: stands under `set` as well",
    ),
    "seed": ("set: {seed: 3}\n", r"c.yaml:3:13: set.seed: is the campaign's own business"),
    "column": ("variables: {Nees: {uniform: {low: 0, high: 1}}}\n", r"c.yaml:3:\d+: variables.Nees: is the name of a col"),
    "runs": ("runs: 0\n", r"c.yaml:3:7: runs: must be greater than or equal to 1, not 0"),
    "inconsistent": ("set: {time.cycle_s: 0.061}\n", r"c.yaml:3:7: time.cycle_s: 0.061 is not a whole multiple"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_mistakes_are_named_with_their_place(case: str, tmp_path: Path) -> None:
    text, expected = WRONG[case]
    found = problems(tmp_path, text)
    assert any(re.match(expected, problem) for problem in found), found


def test_all_mistakes_of_a_kind_at_once(tmp_path: Path) -> None:
    found = problems(
        tmp_path,
        "dispersions:\n  wind.cross: {normal: {mean: 0, sd: 1}}\n  wind.head: {normal: {mean: 0, sd: 1}}\n",
    )
    assert [line.split(": ")[0] for line in found] == ["c.yaml:4:3", "c.yaml:5:3"]


def test_a_scenario_that_is_not_there_or_is_wrong_itself(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("schema_version: 1\nscenario: do128/gusty\n")
    with pytest.raises(file.CampaignError, match=r"c.yaml:2:11: scenario: no such file .*did you mean 'do128/gust'"):
        file.load(path)
    (tmp_path / "mine.yaml").write_text("schema_version: 1\nmission: runway_landing\nrunway: {width_m: -3}\n")
    path.write_text("schema_version: 1\nscenario: mine.yaml\n")
    with pytest.raises(file.CampaignError, match=r"mine.yaml:3:19: runway.width_m: must be greater than 0"):
        file.load(path)


@pytest.mark.parametrize("name", paths.campaign_names())
def test_shipped_campaigns_load_and_name_their_schema(name: str) -> None:
    text = paths.campaign_file(name).read_text()
    assert text.startswith("# yaml-language-server: $schema=../schema_campaign.json\n")
    plan = file.load(name)
    assert plan.campaign.description
    assert plan.campaign.risks
    for run in range(3):
        scenario_of(plan, run, draw(plan.campaign, run))


def test_what_is_shipped() -> None:
    runs = {name: file.load(name).campaign.runs for name in paths.campaign_names()}
    assert runs == {"do128/campaign_wind": 1000, "transport/campaign_average": 2000, "transport/campaign_limit": 2000}
    average = {r.name: r.probability for r in file.load("transport/campaign_average").campaign.risks}
    limit = {r.name: r.probability for r in file.load("transport/campaign_limit").campaign.risks}
    assert average == {name: 10.0 ** (-8 if name == "bank" else -6) for name in average}
    assert limit == {name: pytest.approx(10.0 * p) for name, p in average.items()}


def test_shipped_schema_is_the_models() -> None:
    shipped = paths.data_folder("scenarios") / "schema_campaign.json"
    assert shipped.read_text() == file.schema_text(), (
        "run: landing-sim schema --campaign > scenarios/schema_campaign.json"
    )


def test_figures_are_the_judges(tmp_path: Path) -> None:
    from flights import fly

    from landing_sim.campaign.landing import measure

    wanted = scenario.load("do128/gust", ["time.limit_s=1.2"])
    assert tuple(measure(fly("do128/gust", "time.limit_s=1.2"), wanted)) == figures("runway_landing")


# ------------------------------------------------------------------------------------------------ distributions


def sample(text: str, n: int = 4000) -> np.ndarray:
    distribution = Distribution.model_validate_json(text)
    z = np.random.default_rng(3).standard_normal(n)
    return np.array([quantile(distribution, float(x)) for x in z])


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ('{"normal": {"mean": 2, "sd": 3}}', stats.norm(2, 3)),
        ('{"uniform": {"low": -1, "high": 4}}', stats.uniform(-1, 5)),
        ('{"truncated_normal": {"mean": 7.5, "sd": 7.5, "low": -10, "high": 30}}',
         stats.truncnorm(-17.5 / 7.5, 3, 7.5, 7.5)),
        ('{"truncated_normal": {"mean": 0, "sd": 1, "low": 4, "high": 9}}', stats.truncnorm(4, 9)),
    ],
)  # fmt: skip
def test_samples_follow_their_law(text: str, law: Any) -> None:
    assert stats.kstest(sample(text), law.cdf).pvalue > 0.01


def test_a_table_fills_its_bins_by_weight_and_evenly() -> None:
    found = sample('{"table": {"bins": [[-10, 0, 1], [0, 1, 3], [5, 6, 0], [6, 7, 4]]}}', 8000)
    shares = [np.mean((found >= low) & (found < high)) for low, high in ((-10, 0), (0, 1), (5, 6), (6, 7))]
    np.testing.assert_allclose(shares, [0.125, 0.375, 0.0, 0.5], atol=0.02)
    assert stats.kstest(found[found > 6] - 6, stats.uniform().cdf).pvalue > 0.01


def test_a_choice_keeps_words_and_weights() -> None:
    found = sample('{"choice": {"values": ["a", "b", "c"], "weights": [1, 0, 3]}}')
    assert np.mean(found == "a") == pytest.approx(0.25, abs=0.03)
    assert set(found) == {"a", "c"}


def test_quantiles_rise_with_z_and_stay_within_their_limits() -> None:
    for text in ('{"truncated_normal": {"mean": 0, "sd": 1, "low": -2, "high": 5}}',
                 '{"table": {"bins": [[0, 1, 1], [1, 4, 2]]}}', '{"uniform": {"low": 0, "high": 1}}'):  # fmt: skip
        d = Distribution.model_validate_json(text)
        values = [quantile(d, z) for z in np.linspace(-9.0, 9.0, 181)]
        assert all(a <= b for a, b in zip(values, values[1:]))
        assert math.isfinite(values[0])


def test_units_are_what_they_are() -> None:
    assert factor("wind.crosswind_mps", "kt") == pytest.approx(0.514444, abs=1e-6)
    assert factor("runway.elevation_m", "ft") == 0.3048
    assert factor("aircraft.mass_kg", None) == 1.0
    assert all(table[name] == 1.0 for name, table in FACTORS.items())


# ------------------------------------------------------------------------------------------------ draws

TWO = (
    "dispersions:\n  wind.crosswind_mps: {normal: {mean: 0, sd: 1}}\n  wind.headwind_mps: {normal: {mean: 1, sd: 2}}\n"
)


def test_a_dispersion_more_changes_no_other_draw(tmp_path: Path) -> None:
    one = load(tmp_path, "seed: 9\n" + TWO).campaign
    added = "dispersions:\n  camera.noise_dn: {uniform: {low: 1, high: 2}}\n"
    more = load(tmp_path, "seed: 9\n" + TWO.replace("dispersions:\n", added)).campaign
    for run in (0, 7, 417):
        assert draw(one, run).items() <= draw(more, run).items()
    assert draw(one, 0) != draw(one, 1)
    z = Noise(9, "dispersion wind.headwind_mps", 417).normal(1)[0]
    assert draw(one, 417)["wind.headwind_mps"] == 1.0 + 2.0 * z


def test_sobol_extends_and_covers(tmp_path: Path) -> None:
    campaign = load(tmp_path, "sampling: sobol\n" + TWO).campaign
    z = np.array([list(normals(campaign, run).values()) for run in range(64)])
    cells = np.floor(8.0 * stats.norm.cdf(z)).astype(int)
    assert sorted(map(tuple, cells)) == [(i, j) for i in range(8) for j in range(8)]  # a (0, 6, 2)-net
    assert list(normals(campaign, 5).values()) == z[5].tolist()  # in any order
    other = load(tmp_path, "seed: 2\nsampling: sobol\n" + TWO).campaign
    assert list(normals(other, 5).values()) != z[5].tolist()


def test_correlation_is_that_of_the_normals(tmp_path: Path) -> None:
    text = TWO + "correlations: [{of: [wind.crosswind_mps, wind.headwind_mps], matrix: [[1, -0.6], [-0.6, 1]]}]\n"
    campaign = load(tmp_path, text).campaign
    z = np.array([list(normals(campaign, run).values()) for run in range(3000)])
    np.testing.assert_allclose(np.cov(z.T), [[1, -0.6], [-0.6, 1]], atol=0.06)


def test_derived_values_and_units(tmp_path: Path) -> None:
    text = """variables:
  along_mps: {uniform: {low: 10, high: 20, unit: kt}}
dispersions:
  wind.headwind_mps: {derived: {of: along_mps}}
  wind.crosswind_mps: {derived: {of: wind.headwind_mps, scale: -0.5, offset: 1}}
  wind.turbulence.wind_at_20ft_mps: {derived: {of: [wind.headwind_mps, wind.crosswind_mps], scale: 2}}
"""
    plan = load(tmp_path, text)
    found = draw(plan.campaign, 3)
    head = found["wind.headwind_mps"]
    assert 10 * 0.5144 < head == found["along_mps"] < 20 * 0.5145
    cross = 1.0 - 0.5 * head
    assert found["wind.turbulence.wind_at_20ft_mps"] == 2.0 * math.hypot(head, cross)
    wanted = scenario_of(plan, 3, found)
    assert wanted.wind.turbulence is not None
    assert (wanted.wind.crosswind_mps, wanted.run, wanted.seed) == (cross, 3, 1)
    assert set(plan.campaign.drawn()) == {"along_mps"}


def test_a_sweep_holds_its_values_in_turn(tmp_path: Path) -> None:
    plan = load(tmp_path, "sweep: {path: wind.crosswind_mps, values: [10, 20], unit: kt}\n")
    held = [draw(plan.campaign, run)["wind.crosswind_mps"] for run in range(3)]
    assert held == pytest.approx([5.1444, 10.2889, 5.1444], abs=1e-4)


def test_what_is_dispersed_can_be_held_instead(tmp_path: Path) -> None:
    text = """variables: {along_mps: {uniform: {low: 0, high: 10}}}
dispersions:
  wind.headwind_mps: {derived: {of: along_mps, scale: 2}}
  wind.crosswind_mps: {uniform: {low: 0, high: 2}}
"""
    free = load(tmp_path, text).campaign
    held = load(tmp_path, text + "sweep: {path: along_mps, values: [1, 3]}\n")
    found = draw(held.campaign, 1)
    assert (found["along_mps"], found["wind.headwind_mps"]) == (3.0, 6.0)
    assert found["wind.crosswind_mps"] == draw(free, 1)["wind.crosswind_mps"]  # all else as ever
    assert scenario_of(held, 1, found).wind.headwind_mps == 6.0
    assert set(held.campaign.drawn()) == {"wind.crosswind_mps"}
    assert held.campaign.names() == ["along_mps", "wind.headwind_mps", "wind.crosswind_mps"]
    path = load(tmp_path, text + "sweep: {path: wind.crosswind_mps, values: [5]}\n")
    assert scenario_of(path, 0, draw(path.campaign, 0)).wind.crosswind_mps == 5.0


def test_each_variable_is_held_at_its_ends_to_find_the_worst(tmp_path: Path) -> None:
    from landing_sim.campaign.worst import ends, holding

    text = """dispersions:
  wind.crosswind_mps: {uniform: {low: 0, high: 10, unit: kt}}
  wind.headwind_mps: {normal: {mean: 1, sd: 2}}
  filter.kind: {choice: {values: [augmented, plain]}}
correlations: [{of: [wind.crosswind_mps, wind.headwind_mps], matrix: [[1, 0.5], [0.5, 1]]}]
"""
    plan = load(tmp_path, text)
    low, high = ends(plan.campaign, "wind.crosswind_mps")
    assert (low, high) == (pytest.approx(0.1 * 0.5144, rel=1e-3), pytest.approx(9.9 * 0.5144, rel=1e-3))
    with pytest.raises(ValueError, match="words"):
        ends(plan.campaign, "filter.kind")
    held = holding(plan, "wind.crosswind_mps", (low, high), 3)
    assert held.campaign.runs == 6
    assert [draw(held.campaign, run)["wind.crosswind_mps"] for run in range(4)] == [low, high, low, high]
    assert held.identity() != plan.identity()


def test_other_noise_moves_everything(tmp_path: Path) -> None:
    class Zero:
        def normal(self, size: int) -> np.ndarray:
            return np.zeros(size)

        def key(self) -> int:
            return 0

    campaign = load(tmp_path, TWO).campaign
    assert draw(campaign, 3, lambda name: Zero()) == {"wind.crosswind_mps": 0.0, "wind.headwind_mps": 1.0}


def test_identity_is_that_of_the_landings(tmp_path: Path) -> None:
    base = load(tmp_path, TWO).identity()
    assert load(tmp_path, TWO + "runs: 7\nname: x\nkeep: none\n").identity() == base
    assert load(tmp_path, TWO + "risks: [{name: a, metric: nis, above: 3, probability: 0.1}]\n").identity() == base
    for changed in ("seed: 2\n", "sampling: sobol\n", "set: {camera.noise_dn: 3}\n"):
        assert load(tmp_path, TWO + changed).identity() != base
    assert load(tmp_path, TWO.replace("sd: 2", "sd: 2.5")).identity() != base


def test_a_plan_survives_its_store(tmp_path: Path) -> None:
    plan = load(tmp_path, TWO, runs=3)
    assert plan.campaign.runs == 3
    again = Campaign.model_validate_json(json.dumps(plan.campaign.model_dump(mode="json")))
    assert again == plan.campaign
