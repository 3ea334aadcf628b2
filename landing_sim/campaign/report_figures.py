"""The figures of a campaign's report, as SVG: bounds of every risk, footprint, histograms and tails, sensitivity, NEES."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from landing_sim.campaign.sensitivity import Sensitivity
from landing_sim.campaign.tails import Tail
from landing_sim.campaign.verdict import FAIL, PASS, Judged
from landing_sim.papers.drawing import CLAIM, ESTIMATED, OTHER, TRUE, svg
from landing_sim.types import Array
from landing_sim.world.markings import runway_markings

COLOURS = {PASS: "#2d6a4f", FAIL: "#b23a2e"}
OPEN_COLOUR = "#b7791f"
INK = "#33415c"
SMALLEST = 1e-14  # probabilities below are drawn there
_UNITS = {"m": "m", "mps": "m/s", "deg": "°", "percent": "%", "kg": "kg", "K": "K", "s": "s", "kt": "kt"}


def label(metric: str) -> str:
    """Words and unit of a column: "touchdown x [m]", "wind headwind [m/s]"."""
    *words, unit = metric.replace(".", " ").replace("_", " ").split(" ")
    if unit in _UNITS and words:
        return f"{' '.join(words)} [{_UNITS[unit]}]"
    return " ".join([*words, unit])


def bounds(rows: Sequence[Judged]) -> str:
    """Every risk's 95 % intervals by each method on one logarithmic scale, beside what must be shown."""

    def draw(ax: Any) -> None:
        drawn: set[str] = set()

        def bar(y: float, low: float, high: float, middle: float, colour: str, name: str, width: float) -> None:
            ax.plot([max(low, SMALLEST), max(high, SMALLEST)], [y, y], color=colour, lw=width, solid_capstyle="butt",
                    label=None if name in drawn else name)  # fmt: skip
            drawn.add(name)
            if middle > SMALLEST:
                ax.plot(middle, y, "o", color=colour, ms=4.5, mec="white", mew=0.8, zorder=4)

        smallest = min([row.probability for row in rows], default=1e-6)
        for k, row in enumerate(rows):
            ax.axhspan(k - 0.42, k + 0.42, color="#f4f6f9", zorder=0)
            count, tail = row.by_count, row.tail
            bar(k + 0.22, count.lower, count.upper, count.estimate, OTHER, "count, exact", 5)
            if tail is not None:
                name = "tail fit" if tail.good and not row.unmeasured else "tail fit that proves nothing"
                bar(k, tail.lower, tail.upper, tail.probability, TRUE if name == "tail fit" else "#b9d2e3", name, 5)
                smallest = min(smallest, max(tail.upper, SMALLEST))
            if row.rare is not None:
                bar(k - 0.22, row.rare.lower, row.rare.upper, row.rare.estimate, ESTIMATED, "rare-event run", 5)
                smallest = min(smallest, row.rare.lower)
            ax.plot(
                [row.probability] * 2, [k - 0.42, k + 0.42], color=INK, lw=2.2, label=None if k else "must be below"
            )
        ax.set_xscale("log")
        ax.set_xlim(max(smallest / 100.0, SMALLEST), 1.0)
        ax.set_ylim(len(rows) - 0.5, -0.5)
        ax.set_yticks(range(len(rows)), [row.name for row in rows])
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("probability in a landing")
        ax.legend(loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=5, frameon=False)

    return svg(draw, 1, 0.9 + 0.52 * len(rows))


def footprint(
    x: Array,
    y: Array,
    event: np.ndarray,
    odd: np.ndarray,
    width: float,
    length: float,
    box: tuple[float | None, float | None, float | None],
) -> str:
    """Where the wheels touched, on the runway: landings, those that met a risk's event, those that did not end as landings.

    box : nearest x, farthest x, largest |y| that are legal [m]; None where no risk says so
    """
    near, far, side = box
    known = np.isfinite(x) & np.isfinite(y)
    small = 9.0 if known.sum() > 300 else 22.0
    least, most = (np.min(x[known]), np.max(x[known])) if known.any() else (0.0, 0.0)
    begin = min(-60.0, least - 60.0)
    end = min(max(1000.0, most + 120.0, (far or 0.0) + 120.0), length + 100.0)
    half = max(0.5 * width + 5.0, 1.05 * float(np.max(np.abs(y[known]), initial=0.0)) + 2.0, (side or 0.0) + 3.0)

    def draw(ax: Any) -> None:
        from matplotlib.patches import Rectangle

        ax.set_facecolor("#dfe8d8")
        ax.grid(visible=False)
        ax.add_patch(Rectangle((0, -0.5 * width), length, width, color="#6f7682", lw=0))
        for m in runway_markings(width, length):
            if m.x0 < end:
                ax.add_patch(Rectangle((m.x0, m.y0), m.x1 - m.x0, m.y1 - m.y0, color="#eef1f4", lw=0, alpha=0.85))
        if any(edge is not None for edge in box):
            left, right = (near if near is not None else begin), (far if far is not None else end)
            reach = side if side is not None else half
            style: dict[str, Any] = {
                "fill": False,
                "ec": "#3ddc97",
                "lw": 1.8,
                "ls": (0, (6, 3)),
                "label": "legal box",
                "zorder": 5,
            }
            ax.add_patch(Rectangle((left, -reach), right - left, 2 * reach, **style))
        plain = known & ~event & ~odd
        for which, colour, name, size in (
            (plain, "#8ecdf7", "landing", small),
            (odd & known & ~event, "#ffd166", "not landed", 26.0),
            (event & known, "#ff5a4d", "a risk's event", 32.0),
        ):
            if which.any():
                ax.scatter(x[which], y[which], s=size, color=colour, alpha=0.75 if which is plain else 1.0, lw=0,
                           label=f"{name} ({which.sum()})", zorder=6, rasterized=bool(which.sum() > 300))  # fmt: skip
        if plain.sum() > 3:
            ax.plot(np.mean(x[plain]), np.mean(y[plain]), "+", color="#1d2433", ms=13, mew=2.2, zorder=7, label="mean")
        ax.set(xlim=(begin, end), ylim=(half, -half), xlabel="x from the threshold [m]", ylabel="y [m]")
        if ax.get_legend_handles_labels()[0]:
            ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=6, frameon=False)

    return svg(draw, 1, 3.7)


def distribution(row: Judged, values: Array) -> str:
    """A risk's figure: histogram with its limits, and how rare beyond is rare, with the fitted tails."""
    values = values[np.isfinite(values)]

    def draw(axes: Any) -> None:
        left, right = axes
        limits = [limit for limit in (row.below, row.above) if limit is not None]
        left.set_axisbelow(True)
        left.hist(values, bins=min(60, max(6, int(2 * len(values) ** (1 / 3)))), color=TRUE, alpha=0.85, lw=0)
        right.set_yscale("log")
        sides = [(side, limit) for side, limit in ((-1, row.below), (+1, row.above)) if limit is not None]
        for side, limit in sides:
            _survival(right, side, values, limit, next((t for t in _tails(row) if t.side == side), None), row)
        for ax in axes:
            for k, limit in enumerate(limits):
                ax.axvline(limit, color="#b23a2e", lw=1.6, label=None if k else "limit")
            ax.set_xlabel(label(row.metric))
        left.set_ylabel("landings")
        right.set_ylabel("share of landings beyond")
        right.axhline(row.probability, color=INK, lw=1.0, ls="--", label="must be below")
        right.set_ylim(min(row.probability / 30.0, 0.2 / max(len(values), 1)), 1.5)
        handles, names = right.get_legend_handles_labels()
        unique = dict(zip(names, handles))
        right.legend(
            unique.values(), unique.keys(), loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False
        )

    return svg(draw, 2, 3.2)


def _tails(row: Judged) -> tuple[Tail, ...]:
    return () if row.tail is None else row.tail.tails


def _survival(ax: Any, side: int, values: Array, limit: float, tail: Tail | None, row: Judged) -> None:
    """The share of values at x or beyond, and its fitted tail out past the limit."""
    ordered = np.sort(side * values)[::-1]
    if row.above is not None and row.below is not None:  # the outer half alone: the inner ones would cross
        ordered = ordered[: (len(ordered) + 1) // 2]
    share = np.arange(1, len(ordered) + 1) / max(row.n, 1)
    ax.plot(side * ordered, share, ".", ms=3.5, color=TRUE, label="landings", rasterized=len(values) > 500)
    if tail is None:
        return
    reach = max(side * limit, side * tail.threshold) + 0.08 * abs(limit - tail.threshold)
    x = side * np.linspace(side * tail.threshold, reach, 200)
    p = tail.exceedance(x)
    good = tail.p_value >= 0.05
    ax.plot(x[p > 0], p[p > 0], color=ESTIMATED, ls="-" if good else ":", lw=1.8,
            label="fitted tail" if good else "tail that does not fit")  # fmt: skip
    if row.tail is not None and len(row.tail.tails) == 1:
        ax.plot([limit] * 2, [max(row.tail.lower, 1e-300), row.tail.upper], color=ESTIMATED, lw=4.5, alpha=0.45,
                solid_capstyle="butt", label="95 % of it at the limit")  # fmt: skip


def effects(found: Sequence[Sensitivity], most: int = 7) -> str:
    """First-order Sobol indices with intervals, two figures side by side; the sign is that of the rank regression."""

    def draw(axes: Any) -> None:
        for ax, one in zip(np.atleast_1d(axes), found):
            shown = one.effects[:most]
            for k, effect in enumerate(shown):
                rising = effect.srrc >= 0
                clear = effect.srrc_low > 0 or effect.srrc_high < 0
                colour = (ESTIMATED if rising else TRUE) if clear else OTHER
                ax.barh(k, effect.first_order, color=colour, height=0.62, alpha=0.9)
                ax.plot([effect.first_order_low, effect.first_order_high], [k, k], color=INK, lw=1.3)
            ax.set_yticks(range(len(shown)), [label(effect.name) for effect in shown])
            ax.set_ylim(most - 0.5, -0.5)
            ax.set_xlim(0.0, max(0.3, *(1.08 * effect.first_order_high for effect in shown)))
            ax.tick_params(axis="y", length=0)
            ax.grid(axis="y", visible=False)
            ax.set_title(f"{label(one.metric)}, ranks: R² = {one.r_squared:.2f}")
            ax.set_xlabel("share of the variance")
        for ax in np.atleast_1d(axes)[len(found) :]:
            ax.set_visible(False)

    return svg(draw, 2, 3.1)


def consistency(bands: Mapping[str, Array]) -> str:
    """NEES per state of each stretch of the approach: median, middle half, 5th to 95th percentile over the landings."""

    def draw(ax: Any) -> None:
        names = list(bands)
        ax.axhspan(0.5, 2.0, color="#6a994e22", lw=0)
        ax.axhline(1.0, color=CLAIM, lw=1.4)
        for k, name in enumerate(names):
            values = bands[name][np.isfinite(bands[name])]
            if not len(values):
                continue
            low, q1, middle, q3, high = np.percentile(values, [5, 25, 50, 75, 95])
            ax.plot([k, k], [low, high], color=TRUE, lw=1.6)
            ax.plot([k, k], [q1, q3], color=TRUE, lw=11, solid_capstyle="butt", alpha=0.75)
            ax.plot([k - 0.09, k + 0.09], [middle, middle], color="white", lw=2.2)
            ax.plot([k - 0.13, k + 0.13], [np.mean(values)] * 2, color=ESTIMATED, lw=2.2, label=None if k else "mean")
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        ax.set_ylim(min(low, 0.3), max(high, 3.0))
        ticks = [tick for tick in (0.01, 0.03, 0.1, 0.3, 0.5, 1, 2, 3, 10, 30, 100, 1000) if low / 3 < tick < high * 3]
        ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.minorticks_off()
        ax.set_xticks(range(len(names)), names)
        ax.set_xlim(-0.6, len(names) - 0.4)
        ax.set_ylabel("NEES per state")
        ax.grid(axis="x", visible=False)
        ax.legend(loc="upper right")

    return svg(draw, 1, 2.9)


def swept(values: Sequence[float], rows: Mapping[str, Sequence[Judged]], path: str) -> str:
    """Each risk's bounds over the sweep, on logarithmic scales: one small figure a risk, three a row."""

    def draw(axes: Any) -> None:
        for ax, (name, judged) in zip(np.atleast_1d(axes), rows.items()):
            for value, row in zip(values, judged):
                colour = COLOURS.get(row.verdict, OPEN_COLOUR)
                low, high = max(row.lower95, SMALLEST), max(row.upper95, SMALLEST)
                ax.plot([value, value], [low, high], color=colour, lw=6, solid_capstyle="butt")
            ax.axhline(judged[0].probability, color=INK, lw=1.2, ls="--")
            ax.set_yscale("log")
            least = min(judged[0].probability, *(row.upper95 for row in judged))
            ax.set_ylim(max(0.03 * least, 0.1 * SMALLEST), 1.5)
            ax.set_xticks(values, [f"{value:g}" for value in values])
            ax.set_title(name)
            ax.set_xlabel(label(path))
        for ax in np.atleast_1d(axes)[len(rows) :]:
            ax.set_visible(False)

    return svg(draw, 3, 2.5)
