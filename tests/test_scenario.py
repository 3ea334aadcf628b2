"""Scenario files: what loads, and that everything wrong is said with its place, all at once."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from landing_sim import config, paths, scenario, yamlfile
from landing_sim.errors import ScenarioError

HEAD = "schema_version: 1\nmission: runway_landing\n"


def load(tmp_path: Path, text: str | bytes, *overrides: str) -> scenario.Scenario:
    file = tmp_path / "s.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return scenario.load(file, overrides)


def problems(tmp_path: Path, text: str | bytes, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, text, *overrides)
    return [line.removeprefix(f"{tmp_path}/") for line in str(caught.value).splitlines()]


def test_defaults_are_the_acceptance_setting(tmp_path: Path) -> None:
    s = load(tmp_path, HEAD)
    assert (s.camera.width_px, s.camera.height_px, s.camera.focal_px) == (512, 512, 2000.0)
    assert (s.camera.blur_px, s.camera.noise_dn, s.time.cycle_s) == (0.7, 4.0, 0.06)
    assert s.runway.grey.surface - s.runway.grey.grass == 55.0
    assert (s.sensors.gyro.bias_dps, s.sensors.gyro.noise_dps, s.sensors.airspeed.noise_mps) == (0.1, 0.1, 0.5)
    assert (s.camera.platform.encoder_bias_deg, s.control.delay_s) == (0.03, 0.06)
    assert (s.believed.aero_sigma, s.believed.mass_sigma) == (0.08, 0.03)
    start = s.initial
    assert (start.x_m, start.y_m, start.height_m, start.heading_deg, start.airspeed_mps) == (-950, -85, 51, 15, 50)
    assert (s.runway.width_m, s.runway.length_m) == (29.0, 1680.0)
    assert s.name == "s"


@pytest.mark.parametrize("name", paths.scenario_names())
def test_shipped_scenarios_load_and_name_their_schema(name: str) -> None:
    file = paths.scenario_file(name)
    s = scenario.load(name)
    schema = {"runway_landing": "schema", "lunar_landing": "schema_lunar"}.get(s.mission, "schema_quadrotor")
    assert file.read_text().startswith(f"# yaml-language-server: $schema=../{schema}.json\n")
    assert s.description
    again = scenario.MODELS[s.mission].model_validate_json(json.dumps(scenario.dump(s)))
    assert again == s


def test_what_is_shipped() -> None:
    names = ("calm", "gibert", "gust", "gust_light", "gust_moderate", "headwind", "inertial_off", "tailwind")
    assert set(names) == {n.removeprefix("do128/") for n in paths.scenario_names() if n.startswith("do128/")}
    assert {"transport/gibert_far", "transport/gibert_near", "transport/ekf"} <= set(paths.scenario_names())
    gust = scenario.load("do128/gust").wind
    assert (gust.crosswind_mps, gust.crosswind_from_x_m) == (-1.0, -800.0)
    assert gust.gust is not None
    assert tuple(gust.gust.model_dump().values()) == (-650.0, -2.0, 1.0, 6.0)
    assert scenario.load("do128/headwind").wind.headwind_mps == 5.0
    assert scenario.load("do128/tailwind").wind.headwind_mps == -5.0
    for severity in ("light", "moderate"):
        turbulence = scenario.load(f"do128/gust_{severity}").wind.turbulence
        assert turbulence is not None
        assert turbulence.severity == severity
    limits = {c.metric: (c.low, c.high) for c in scenario.load("do128/calm").criteria}
    assert limits["touchdown_x_m"] == (250.0, 900.0)


def test_shipped_schema_is_the_models() -> None:
    shipped = paths.data_folder("scenarios") / "schema.json"
    assert shipped.read_text() == scenario.schema_text(), "run: landing-sim schema > scenarios/schema.json"
    lunar = paths.data_folder("scenarios") / "schema_lunar.json"
    told = "run: landing-sim schema --lunar > scenarios/schema_lunar.json"
    assert lunar.read_text() == scenario.schema_text("lunar_landing"), told
    quadrotor = paths.data_folder("scenarios") / "schema_quadrotor.json"
    told = "run: landing-sim schema --quadrotor > scenarios/schema_quadrotor.json"
    assert quadrotor.read_text() == scenario.schema_text("quadrotor_landing"), told


def test_every_value_is_described() -> None:
    def walk(node: Any) -> None:
        for name, value in node.get("properties", {}).items():
            assert value.get("description"), name
        for definition in node.get("$defs", {}).values():
            assert definition.get("description"), definition.get("title")
            walk(definition)

    for mission in scenario.MODELS:
        walk(scenario.schema(mission))


WRONG = {
    "unknown key": ("wind:\n  turbulance: {}\n", r"s.yaml:4:3: wind.turbulance: unknown key .*mean 'turbulence'\?\)"),
    "wrong type": ("runway:\n  width_m: wide\n", r"s.yaml:4:12: runway.width_m: must be a valid number, not 'wide'"),
    "number as text": ("seed: '3'\n", r"s.yaml:3:7: seed: must be a valid integer, not '3'"),
    "truth value": ("initial: {x_m: true}\n", r"s.yaml:3:16: initial.x_m: must be a valid number, not true"),
    "YAML 1.1 truth": ("runway: {markings: on}\n", r"s.yaml:3:20: runway.markings: must be a valid boolean, not 'on'"),
    "nan": ("initial: {y_m: .nan}\n", r"s.yaml:3:16: initial.y_m: must be a finite number, not nan"),
    "inf": ("time: {limit_s: .inf}\n", r"s.yaml:3:17: time.limit_s: must be a finite number, not inf"),
    "overflow": ("time: {limit_s: 1e999}\n", r"s.yaml:3:17: time.limit_s: must be a finite number, not inf"),
    "negative width": ("runway: {width_m: -29}\n", r"s.yaml:3:19: runway.width_m: must be greater than 0, not -29"),
    "period": (
        "time: {cycle_s: 0.061}\ncamera: {period_s: 0.061}\n",
        r"s.yaml:3:17: time.cycle_s: 0.061 is not a whole multiple of time.step_s = 0.005",
    ),
    "camera period": (
        "camera: {period_s: 0.07}\n",
        r"s.yaml:3:20: camera.period_s: 0.07 is not a whole multiple of time.cycle_s = 0.06",
    ),
    "delay": ("control: {delay_s: 0.003}\n", r"s.yaml:3:20: control.delay_s: 0.003 is not a whole multiple"),
    "aircraft": ("aircraft: {model: do127}\n", r"s.yaml:3:19: aircraft.model: no aircraft 'do127' .*mean 'do128'\?\)"),
    "duplicate": ("seed: 1\nseed: 2\n", r"s.yaml:4:1: seed: duplicate key, first given on line 3"),
    "tag": ("name: !!python/object/apply:os.system [ls]\n", r"s.yaml:3:7: name: tags are not allowed"),
    "local tag": ("seed: !seed 3\n", r"s.yaml:3:7: seed: tags are not allowed: !seed"),
    "anchor": ("name: &a gust\n", r"s.yaml:3:7: name: anchors are not allowed"),
    "merge key": ("<<: {seed: 1}\n", r"s.yaml:3:1: <<: unknown key"),
    "two documents": ("---\nseed: 1\n", r"s.yaml:3:1: \(file\): more than one YAML document"),
    "syntax": ("seed: [1\n", r"s.yaml:4:1: \(file\): not YAML: "),
    "tab": ("wind:\n\theadwind_mps: 3\n", r"s.yaml:4:1: \(file\): not YAML: "),
    "complex key": ("? [1, 2]\n: 3\n", r"s.yaml:3:3: \(file\): a key must be a plain word"),
    "section is a number": ("camera: 3\n", r"s.yaml:3:9: camera: must be a mapping of keys to values, not 3"),
    "null section": ("camera:\n", r"s.yaml:3:1: camera: must be a mapping of keys to values, not null"),
    "fault of no kind": ("faults:\n  - {sensor: gyro}\n", r"s.yaml:4:5: faults.0.kind: missing: this key is required"),
    "literal": (
        "camera: {renderer: line_a}\n",
        r"s.yaml:3:20: camera.renderer: must be .* \(did you mean 'line_aa'\?\)",
    ),
    "metric": ("criteria: [{metric: rang_m, high: 1}]\n", r"s.yaml:3:21: criteria.0.metric: .*did you mean 'range_m'"),
    "limits missing": ("criteria: [{metric: range_m}]\n", r"s.yaml:3:12: criteria.0: needs low, high or both"),
    "limits crossed": ("criteria: [{metric: nis, low: 2, high: 1}]\n", r"s.yaml:3:31: criteria.0.low: is above"),
    "turbulence twice": (
        "wind: {turbulence: {severity: light, wind_at_20ft_mps: 3}}\n",
        r"s.yaml:3:20: wind.turbulence: give one of",
    ),
    "taxiway off the end": (
        "runway: {taxiways: [{x_m: 1679, side: left}]}\n",
        r"s.yaml:3:27: runway.taxiways.0.x_m: its mouth reaches past",
    ),
    "taxiway without side": ("runway: {taxiways: [{x_m: 300}]}\n", r"s.yaml:3:21: runway.taxiways.0.side: missing"),
    "windows": ("vision: {windows: 3L3R2T}\n", r"s.yaml:3:19: vision.windows: "),
    "name that leads elsewhere": ("name: ../../etc\n", r"s.yaml:3:7: name: "),
    "half a letter": ('name: "\\ud800"\n', r"s.yaml:3:7: name: half of a surrogate pair"),
}


@pytest.mark.parametrize("case", WRONG)
def test_mistakes_are_named_with_their_place(case: str, tmp_path: Path) -> None:
    text, expected = WRONG[case]
    found = problems(tmp_path, HEAD + text)
    assert len(found) == 1, found
    assert re.match(expected, found[0]), found


def test_all_mistakes_at_once_in_order(tmp_path: Path) -> None:
    found = problems(tmp_path, HEAD + "wind:\n  gusts: 3\nseed: x\ncamera: {focal_px: -1}\nbogus: 1\n")
    assert [line.split(": ")[1] for line in found] == ["wind.gusts", "seed", "camera.focal_px", "bogus"]


def test_schema_version_is_required_and_known(tmp_path: Path) -> None:
    assert problems(tmp_path, "mission: runway_landing\n") == [
        "s.yaml:1:1: schema_version: missing: this key is required"
    ]
    assert problems(tmp_path, HEAD.replace("1", "2", 1)) == ["s.yaml:1:17: schema_version: must be 1, not 2"]


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (b"", "s.yaml:1:1: (file): must hold a mapping of keys to values, but is empty"),
        (b"# nothing\n", "s.yaml:1:1: (file): must hold a mapping of keys to values, but is empty"),
        (b"- 1\n", "s.yaml:1:1: (file): must hold a mapping of keys to values, but is a list"),
        (b"hello", "s.yaml:1:1: (file): must hold a mapping of keys to values, but is a text"),
        (b"a: 1\nb: \xff\n", "s.yaml:2:4: (file): not UTF-8 text"),
        (b"a: 1\nb: \x00\n", "s.yaml:2:4: (file): not YAML: special characters are not allowed"),
        (b"x" * (2 << 20), "s.yaml:1:1: (file): larger than 1 MiB"),
        (b"a: " + b"[" * 50_000, "s.yaml:1:24: a.0.0: nested deeper than 20 levels"),
        (b"a: " + b"{a: " * 21, "s.yaml:1:84: a.a.a: nested deeper than 20 levels"),
        (b"a: [" + b"1," * 30_000 + b"]", "s.yaml:1:39999: a.19997: more than 20000 values"),
    ],
)
def test_files_that_are_no_scenario(raw: bytes, expected: str, tmp_path: Path) -> None:
    assert problems(tmp_path, raw) == [expected]


def test_places_that_are_no_file(tmp_path: Path) -> None:
    cases = {
        str(tmp_path): "is a directory, not a file",
        "/dev/null": "is not a regular file",
        str(tmp_path / "none.yaml"): "no such file or shipped scenario",
        "do128/gusty": "(did you mean 'do128/gust'?)",
        "gust_ligth": "(did you mean 'do128/gust_light'?)",
        "a" * 5000: "no such file",
        "a\0b": "no such file",
    }
    for name, message in cases.items():
        with pytest.raises(ScenarioError, match=re.escape(message)):
            scenario.load(name)


def test_an_unreadable_file_is_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    (tmp_path / "s.yaml").touch()
    with pytest.raises(ScenarioError, match="cannot be read: Permission denied"):
        scenario.load(tmp_path / "s.yaml")


def test_yaml_is_1_2(tmp_path: Path) -> None:
    text = "a: 1e3\nb: 12:30\nc: NO\nd: 0x10\ne: 0o17\nf: 007\ng: -.5\nh: ~\ni: '1'\nj: |\n  3\nk: 1_000\n"
    data = yamlfile.parse(text, "x").data
    assert data == {
        "a": 1000.0, "b": "12:30", "c": "NO", "d": 16, "e": 15, "f": 7, "g": -0.5, "h": None, "i": "1", "j": "3\n",
        "k": "1_000",
    }  # fmt: skip


def test_set_changes_values_and_lists(tmp_path: Path) -> None:
    text = HEAD + "runway: {taxiways: [{x_m: 300, side: left}]}\n"
    s = load(
        tmp_path, text, "wind.gust.lateral_mps=-3", "runway.taxiways.0.x_m=400", "filter.gate_sigma=null", "seed=7",
        "camera.platform={lag_s: 0.2}", "name=a=b",
    )  # fmt: skip
    assert s.wind.gust is not None
    assert (s.wind.gust.lateral_mps, s.wind.gust.time_constant_s) == (-3.0, 6.0)
    assert (s.runway.taxiways[0].x_m, s.runway.taxiways[0].side) == (400.0, "left")
    assert (s.filter.gate_sigma, s.seed, s.camera.platform.lag_s, s.name) == (None, 7, 0.2, "a=b")


@pytest.mark.parametrize(
    ("assignment", "expected"),
    [
        ("runway.width_m=-1", "--set runway.width_m: runway.width_m: must be greater than 0, not -1"),
        ("wind.gusst.x=1", "--set wind.gusst.x: wind.gusst: unknown key (did you mean 'gust'?)"),
        ("seed=.nan", "--set seed: seed: must be a valid integer, not nan"),
        ("initial.x_m=.inf", "--set initial.x_m: initial.x_m: must be a finite number, not inf"),
        ("seed.x=1", "--set seed.x: seed: is a number, which has no key 'x'"),
        ("runway.taxiways.0.x_m=1", "--set runway.taxiways.0.x_m: runway.taxiways: must be a list, not a mapping"),
        ("criteria.99.high=1", "--set criteria.99.high: criteria: the list has 1 items, counted from 0"),
        ("seed", "--set seed: (file): must look like path.to.key=value"),
        ("=3", "--set : (file): must look like path.to.key=value"),
        ("a..b=3", "--set a..b: (file): must look like path.to.key=value"),
        ("seed=[1", "--set seed: seed: not YAML: expected ',' or ']'"),
        ("seed=!x 1", "--set seed: seed: tags are not allowed: !x"),
        ("aircraft.model=dox", "--set aircraft.model: aircraft.model: no aircraft 'dox'"),
        (
            "time.cycle_s=0.0601",
            "--set time.cycle_s: time.cycle_s: 0.0601 is not a whole multiple of time.step_s = 0.005",
        ),
        (".".join("a" * 30) + "=1", f"--set {'.'.join('a' * 30)}: (file): nested deeper than 20 levels"),
    ],
)
def test_set_mistakes_name_the_option(assignment: str, expected: str, tmp_path: Path) -> None:
    text = HEAD + "seed: 3\ncriteria: [{metric: nis, high: 1}]\n"
    found = problems(tmp_path, text, assignment)
    assert found[0].startswith(expected), found


def test_set_replaces_the_place_of_what_it_replaces(tmp_path: Path) -> None:
    found = problems(tmp_path, HEAD + "wind:\n  gust: {at_x_m: 3}\n", "wind.gust={at_x_m: x}")
    assert found == ["--set wind.gust: wind.gust.at_x_m: must be a valid number, not 'x'"]


def test_values_are_frozen(tmp_path: Path) -> None:
    s = load(tmp_path, HEAD)
    with pytest.raises(ValueError, match="frozen"):
        s.runway.width_m = 3.0  # type: ignore[misc]
    assert isinstance(s.runway.taxiways, tuple)


def test_whole_multiples_bear_rounding(tmp_path: Path) -> None:
    for cycle in ("0.06", "0.16", "0.02", "0.3"):
        s = load(tmp_path, HEAD + f"time: {{cycle_s: {cycle}}}\ncamera: {{period_s: {cycle}}}\n")
        assert math.isclose(s.camera.period_s, float(cycle))


FUZZ = settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
WORDS = st.sampled_from(
    ["schema_version", "1", "mission", "runway_landing", "wind", "gust", "runway", "taxiways", "x_m", "{", "}", "[", "]",
     ":", ": ", "- ", "\n", "\n  ", ",", "&a", "*a", "!!str", "!", "?", "|", ">", "'", '"', "#", "%YAML 1.1\n",
     "null", "---", "...", ".nan", "1e999", "<<", "\t", "\u2028", "\ufeff", "\x85", "é", "0x", "0o9", "-", "@", "`",
     "%TAG ! x\n"]
)  # fmt: skip


@FUZZ
@given(st.one_of(st.binary(max_size=300), st.lists(WORDS, max_size=40).map(lambda w: "".join(w).encode())))
def test_any_bytes_give_a_scenario_or_a_scenario_error(tmp_path: Path, raw: bytes) -> None:
    check_any(tmp_path, raw)


@FUZZ
@given(st.text(max_size=80), st.integers(0, 400), st.integers(0, 20))
def test_any_damage_to_a_good_file_does_too(tmp_path: Path, patch: str, at: int, cut: int) -> None:
    good = paths.scenario_file("do128/gust").read_text()
    check_any(tmp_path, (good[:at] + patch + good[at + cut :]).encode("utf-8", "surrogatepass"))


@FUZZ
@given(st.text(max_size=40))
def test_any_set_does_too(tmp_path: Path, text: str) -> None:
    check_any(tmp_path, HEAD.encode(), text)


def check_any(tmp_path: Path, raw: bytes, *overrides: str) -> None:
    """Anything but a scenario or a ScenarioError fails the test by itself."""
    found: ScenarioError | None = None
    try:
        loaded = load(tmp_path, raw, *overrides)
    except ScenarioError as error:
        found = error
    if found is None:
        assert loaded.schema_version == 1
        return
    assert found.problems
    assert all(p.mark.line >= 1 and p.mark.column >= 1 and p.message for p in found.problems)


def test_a_model_cannot_be_built_inconsistent_in_code() -> None:
    with pytest.raises(ValueError, match="whole multiple"):
        scenario.Scenario(schema_version=1, mission="runway_landing", time=scenario.Time(cycle_s=0.061))
    assert config.Section.model_config["frozen"]
