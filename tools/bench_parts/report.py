"""The bench's figures for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

RATIOS = (
    ("ratio", "closed loop / bare JSBSim"),
    ("own_recorded_ratio", "  with the scenario's own recording"),
    ("recorded_ratio", "  with 640x480 frames recorded at 10 Hz"),
    ("plant_ratio", "  our plant and wind alone"),
    ("landing_ratio", "  with set-up, against bare with loading"),
)
IMPORTS = (("landing_sim", "import landing_sim"), ("help", "landing-sim --help"), ("check", "landing-sim check"))


def text(found: Mapping[str, Any]) -> str:
    lines: list[str] = []
    for name, figures in found.items():
        if name != "imports":
            lines += [*_aircraft(name, figures), ""]
    if "imports" in found:
        lines += _imports(found["imports"])
    return "\n".join(lines)


def _aircraft(name: str, f: Mapping[str, Any]) -> Iterator[str]:
    yield f"{name}: {f['seconds']:.1f} s, {f['steps']} steps, {f['frames']} camera frames, {f['outcome']}"
    if f["recorded_outcome"] != f["outcome"]:
        yield f"  with 640x480 frames it does not end so but: {f['recorded_outcome']}"
    yield f"{f['repeats']} interleaved repeats, CPU time             median     min     max"
    for key, label in RATIOS:
        yield f"  {label:44s} {f[f'{key}_median']:7.2f} {f[f'{key}_min']:7.2f} {f[f'{key}_max']:7.2f}"
    yield f"  {'best closed loop / best bare':44s} {f['ratio_of_best']:7.2f}"
    yield f"  {'added to a camera frame [Do 128 bare steps]':44s} {f['added_steps_per_frame']:7.1f} " \
          f"{f['added_steps_per_frame_min']:7.1f} {f['added_steps_per_frame_max']:7.1f}"  # fmt: skip
    yield f"  a step [us]: bare {f['bare_step_us']:.2f} (run alone {f['bare_run_us']:.2f}), plant " \
          f"{f['plant_step_us']:.2f}, closed loop {f['closed_step_us']:.2f}"  # fmt: skip
    yield f"  {f['landings_per_core_minute']:.1f} landings per core-minute, {f['realtime_factor']:.0f} x real time, " \
          f"set-up {f['setup_ms']:.1f} ms, {f['recorded_frames_per_s']:.1f} frames/s recorded"  # fmt: skip
    if "peak_mb" in f:
        yield f"  peak memory {f['peak_mb']:.0f} MB, recording {f['recorded_peak_mb']:.0f} MB"
    if "where" in f:
        yield "  where the time goes                 ms  share    calls  us/call"
        for part, w in f["where"].items():
            yield f"    {part:28s} {w['ms']:9.1f} {100 * w['share']:5.1f}% {w['calls']:8.0f} {w['us_per_call']:8.2f}"
    if "baseline" in f:
        yield from _baseline(f["baseline"])
    if "bound" in f:
        yield from _bound(f["bound"])
    if "many" in f:
        m = f["many"]
        yield f"  {m['landings']:.0f} landings in one process: {m['cpu_per_landing_s']:.3f} s CPU each, a single one " \
              f"{m['single_run_cpu_s']:.3f} s ({m['per_single']:.3f}); " \
              f"memory {m['first_mb']:.0f} -> {m['last_mb']:.0f} MB, " \
              f"{m['growth_kb_per_landing']:.1f} kB a landing"  # fmt: skip


def _baseline(b: Mapping[str, Any]) -> Iterator[str]:
    yield f"  beside the afternoon's baseline, {b['frames']}, {b['cycles']} cycles     theirs     ours   ratio"
    for place in ("", "camera_"):
        for name in (f"{place}range", f"{place}height", f"{place}lateral"):
            theirs, ours = b[f"{name}_rms_m"], b[f"our_{name}_rms_m"]
            label = name.replace("_", "'s ") + " RMS, on our frames [m]"
            yield f"    {label:44s} {theirs:8.3f} {ours:8.3f} {b[f'{name}_ratio']:7.1f}"
    for name in ("range", "height", "lateral"):
        theirs, ours = b[f"own_frames_{name}_rms_m"], b[f"our_{name}_rms_m"]
        yield f"    {name + ' RMS, on its own [m]':44s} {theirs:8.3f} {ours:8.3f} {b[f'own_frames_{name}_ratio']:7.1f}"
    on_board, our_on_board = (b[f"{whose}vision_us"] + b[f"{whose}estimate_us"] for whose in ("", "our_"))
    for label, theirs, ours in (
        ("pixels", b["own_render_us"], b["our_render_us"]),
        ("looking", b["vision_us"], b["our_vision_us"]),
        ("estimating", b["estimate_us"], b["our_estimate_us"]),
        ("a frame", b["frame_us"], b["our_frame_us"]),
        ("  the same, given our full frames", b["render_us"] + on_board, b["our_frame_us"]),
        ("  of it on board, pixels given", on_board, our_on_board),
    ):
        yield f"    {label + ' [us CPU]':44s} {theirs:8.0f} {ours:8.0f} {theirs / ours:7.1f}"


def _bound(bound: Mapping[str, Any]) -> Iterator[str]:
    yield "  RMS error and Cramer-Rao bound [m]              error    bound   ratio  worst 100 m"
    for kind, worlds in bound.items():
        for world, figures in worlds.items():
            for name in ("range", "height", "lateral"):
                r = figures[name]
                label = f"{kind}, {world}: {name}"
                yield f"    {label:42s} {r['rms_m']:8.3f} {r['bound_m']:8.3f} {r['ratio']:7.2f} {r['worst_100m']:8.2f}"
            yield f"    {'':42s} true over believed edge errors {figures['edge_error']:.2f}, {figures['flights']} flights"


def _imports(i: Mapping[str, float]) -> Iterator[str]:
    yield "start-up                                       CPU [s]   x import numpy"
    yield f"  {'import numpy':44s} {i['numpy_cpu_s']:8.3f}"
    for key, label in IMPORTS:
        yield f"  {label:44s} {i[f'{key}_cpu_s']:8.3f} {i[f'{key}_per_numpy']:8.2f}"
    for key, value in i.items():
        if key.startswith("first_landing"):
            yield f"  {key.replace('_', ' '):44s} {value:8.2f}"
