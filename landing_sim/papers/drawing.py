"""How a paper's figures are drawn: one look, as SVG with text that can be searched. Same data, same bytes."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

TRUE, ESTIMATED, OTHER, CLAIM, BAND = "#2a6f97", "#e76f51", "#8d99ae", "#6a994e", "#e76f5133"
STYLE = {
    "figure.figsize": (9.2, 3.2),
    "font.size": 9.5,
    "font.family": "sans-serif",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5c677d",
    "axes.labelcolor": "#33415c",
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "#e3e7ee",
    "xtick.color": "#5c677d",
    "ytick.color": "#5c677d",
    "lines.linewidth": 1.5,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "landing-sim",
}


@dataclass(frozen=True, slots=True)
class Figure:
    """One of the paper's figures, redrawn; `place` is where the paper has it."""

    place: str  # "figure 8", "section 7.1"
    title: str
    svg: str
    caption: str

    @property
    def anchor(self) -> str:
        return self.place.replace(" ", "-")


def svg(draw: Callable[[Any], None], columns: int, height: float = 3.2) -> str:
    """What `draw` puts into one axes, or into an array of them side by side; height [in] at a width of 9.2."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    out = io.StringIO()
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, columns, layout="constrained", figsize=(9.2, height))
        draw(axes)
        figure.savefig(out, format="svg", facecolor="white", metadata={"Date": None, "Creator": None})
        plt.close(figure)
    text = out.getvalue()
    return text[text.index("<svg") :]
