"""A paper's claims beside our figures, as one HTML file that needs nothing else: no network, no scripts."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from landing_sim.papers.claims import Row
from landing_sim.papers.drawing import Figure
from landing_sim.papers.paper import Paper
from landing_sim.papers.template import TEMPLATE

_WORDS = {"met": "met", "not_met": "not met", "not_comparable": "not comparable"}


def html(paper: Paper, rows: Sequence[Row], figures: Sequence[Figure], versions: Mapping[str, str]) -> str:
    """The report's text. Same rows and figures, same bytes."""
    import jinja2

    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["number"] = number
    return environment.from_string(TEMPLATE).render(
        paper=paper,
        rows=rows,
        words=_WORDS,
        counts={verdict: sum(row.verdict == verdict for row in rows) for verdict in _WORDS},
        figures=figures,
        settings=_settings(rows),
        versions=versions,
    )


def write(text: str, path: Path) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def number(value: float | None) -> str:
    """Three figures that matter; a dash for what does not exist."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if abs(value) < 5e-5:
        return f"{value:.0e}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(digits, 4)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _settings(rows: Sequence[Row]) -> list[tuple[str, str, str]]:
    """(what, changes, seeds) of every group of jobs."""
    groups: dict[tuple[str, str], list[int]] = {}
    for run in dict.fromkeys(run for row in rows for run in row.claim.runs):
        groups.setdefault(run.setting(), []).extend(run.seeds())
    return [(name, changes, _spans(sorted(set(seeds))) or "–") for (name, changes), seeds in groups.items()]


def _spans(numbers: Sequence[int]) -> str:
    """1, 2, 3, 7 as "1–3, 7"."""
    spans: list[list[int]] = []
    for n in numbers:
        if spans and n == spans[-1][-1] + 1:
            spans[-1].append(n)
        else:
            spans.append([n])
    return ", ".join(
        str(s[0]) if len(s) == 1 else f"{s[0]}, {s[-1]}" if len(s) == 2 else f"{s[0]}–{s[-1]}" for s in spans
    )
