"""From the signals of a row of photoreceptors to angular speed: band-pass, thresholds, edges followed from one to the next.

An edge is where a band-passed signal, having been below minus the threshold, rises above it, or the other way round. One
that crosses the row is found again at each receptor after the same time; the slope of those times is its angular speed.
Edges that do not keep step (another edge taken for it) make no track, and tracks are put to the vote of their predecessors.

Source     principle: Sabiron et al., ICRA 2013 (6-pixel sensor of 2.5 g for 1.5 to 25 deg/s). The algorithm is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_sim.jit import kernel
from landing_sim.types import Array

TRACKS = 48
# columns of a track: in use, direction, last receptor, polarity, last time, interval, count, sums of i, t, i t, i i, t t
_COLUMNS = 12


@dataclass(frozen=True, slots=True)
class EdgeConfig:
    """spacing [rad] between receptors; low, high [Hz] of the band; threshold as a share of the signal's rms, but no less
    than `floor` [DN].

    slowest, fastest : [rad/s] speeds looked for; step : allowed change of the interval from receptor to receptor
    needed : receptors an edge must cross; misfit : largest rms deviation from even steps, of a step
    memory [s], votes : a track counts if most of the last `votes` no older than that go the same way
    """

    spacing: float = math.radians(0.1)
    low: float = 0.3
    high: float = 60.0
    threshold: float = 0.25
    floor: float = 1.5
    slowest: float = math.radians(0.5)
    fastest: float = math.radians(30.0)
    step: float = 0.35
    needed: int = 5
    misfit: float = 0.12
    memory: float = 1.0
    votes: int = 5
    spread: float = 0.35  # a speed further than this share off the voters' median is left out


class EdgeTracker:
    """State of one row of n receptors sampled every dt [s]."""

    def __init__(self, config: EdgeConfig, n: int, dt: float) -> None:
        self._c, self._dt = config, dt
        self._filter = np.zeros((n, 6))  # raw before, high-passed, low-passed twice, hysteresis, rms^2
        self._tracks = np.zeros((TRACKS, _COLUMNS))
        self._past = np.full((config.votes, 2), np.nan)  # time, speed of earlier tracks
        self._t = 0.0
        self._samples = 0

    def feed(self, signals: Array) -> list[tuple[float, float]]:
        """(count, n) new samples; returns (time in the middle of the passage [s], speed [rad/s]) of each believed edge."""
        c = self._c
        found = np.empty((64, 2))
        count = _feed(
            signals, self._filter, self._tracks, self._t, self._dt, self._samples, c.spacing, c.low, c.high, c.threshold,
            c.floor, c.slowest, c.fastest, c.step, c.needed, c.misfit, found,
        )  # fmt: skip
        self._t += len(signals) * self._dt
        self._samples += len(signals)
        return [(float(t), float(w)) for t, w in found[:count] if self._voted(t, w)]

    def _voted(self, t: float, speed: float) -> bool:
        """Remember it, and say whether it agrees with what came before; alone it does not count."""
        past = self._past
        recent = past[past[:, 0] > t - self._c.memory]
        past[:-1] = past[1:]
        past[-1] = t, speed
        if len(recent) == 0 or abs(speed) < self._c.slowest:
            return False
        both = np.append(recent[:, 1], speed)
        middle = float(np.median(both))
        return abs(speed - middle) <= self._c.spread * abs(middle)


@kernel
def _feed(
    signals: Array, state: Array, tracks: Array, t0: float, dt: float, done: int, spacing: float, low: float, high: float,
    threshold: float, floor: float, slowest: float, fastest: float, step: float, needed: int, misfit: float, found: Array,
) -> int:  # fmt: skip
    count, n = signals.shape
    hp = 1.0 / (1.0 + 2.0 * math.pi * low * dt)
    lp = 1.0 - math.exp(-2.0 * math.pi * high * dt)
    forget = dt / 1.5
    out = 0
    for k in range(count):
        t = t0 + (k + 1) * dt
        power = 0.0
        for i in range(n):
            power += state[i, 5]
        level = max(threshold * math.sqrt(power / n), floor)
        for i in range(n):
            raw = signals[k, i]
            if done + k == 0:
                state[i, 0] = raw
            state[i, 1] = hp * (state[i, 1] + raw - state[i, 0])
            state[i, 0] = raw
            state[i, 2] += lp * (state[i, 1] - state[i, 2])
            before = state[i, 3]
            state[i, 3] += lp * (state[i, 2] - state[i, 3])
            now = state[i, 3]
            state[i, 5] += max(forget, 1.0 / (done + k + 1.0)) * (now * now - state[i, 5])
            if (done + k) * dt < 0.3:
                continue
            polarity = 0
            if now > level and state[i, 4] <= 0.0:
                polarity = 1 if state[i, 4] < 0.0 else 0
                state[i, 4] = 1.0
            elif now < -level and state[i, 4] >= 0.0:
                polarity = -1 if state[i, 4] > 0.0 else 0
                state[i, 4] = -1.0
            if polarity != 0 and out < len(found):
                share = (polarity * level - before) / (now - before) if now != before else 1.0
                at = t - dt * (1.0 - min(1.0, max(0.0, share)))
                out = _follow(tracks, i, n, polarity, at, spacing, slowest, fastest, step, needed, misfit, found, out)
    return out


@kernel
def _follow(
    tracks: Array, i: int, n: int, polarity: int, t: float, spacing: float, slowest: float, fastest: float, step: float,
    needed: int, misfit: float, found: Array, out: int,
) -> int:  # fmt: skip
    """An edge at receptor i at time t: to the tracks that it continues, and the beginning of new ones."""
    longest, shortest = spacing / slowest, spacing / fastest
    most, middle, speed = 0.0, 0.0, 0.0  # of the tracks that end here, the one over most receptors
    for k in range(tracks.shape[0]):
        track = tracks[k]
        if track[0] == 0.0:
            continue
        gap = t - track[4]
        if gap > 1.4 * longest:
            track[0] = 0.0
            continue
        if track[3] != polarity or i != int(track[2] + track[1]):
            continue
        if track[6] == 1.0:
            fits = shortest < gap < longest
        else:
            fits = abs(gap - track[5]) <= step * track[5]
        if not fits:
            continue
        track[2], track[4] = i, t
        track[5] = gap if track[6] == 1.0 else track[5] + (gap - track[5]) / track[6]
        track[6] += 1.0
        track[7] += i
        track[8] += t
        track[9] += i * t
        track[10] += i * i
        track[11] += t * t
        end = i + int(track[1])
        if end < 0 or end >= n:
            m = track[6]
            if m >= needed:
                sii = track[10] - track[7] * track[7] / m
                sit = track[9] - track[7] * track[8] / m
                stt = track[11] - track[8] * track[8] / m
                slope = sit / sii
                rest = max(0.0, stt - slope * sit)
                if math.sqrt(rest / m) <= misfit * abs(slope) and m > most:
                    most, middle, speed = m, track[8] / m, spacing / slope
            track[0] = 0.0
    if most > 0.0 and out < len(found):
        found[out, 0], found[out, 1] = middle, speed
        out += 1
    for direction in (1, -1):
        first = 0 if direction == 1 else n - 1
        if abs(i - first) <= n - needed:
            slot, oldest = 0, 1e300
            for k in range(tracks.shape[0]):
                age = tracks[k, 4] if tracks[k, 0] > 0.0 else -1.0
                if age < oldest:
                    slot, oldest = k, age
            tracks[slot] = np.array(
                [1.0, float(direction), float(i), float(polarity), t, 0.0, 1.0, float(i), t, i * t, float(i * i), t * t]
            )
    return out
