"""One module a paper: its claims as data, how each is measured, and the paper's value beside ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PAPERS = ("dickmanns-1992",)


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came of a paper: the object `reproduce --json` prints, and the report's path."""

    result: dict[str, Any]
    report: Path


def reproduce(paper: str, folder: Path, watch: Callable[[str], None] = lambda line: None) -> Reproduction:
    """Fly everything the paper's claims need, judge them, write `report.html` and `claims.json` into `folder`.

    watch : is told what starts, a line at a time. Raises KeyError if the paper is not one of PAPERS.
    """
    if paper not in PAPERS:
        raise KeyError(f"no such paper: {paper!r}; there are: {', '.join(PAPERS)}")
    import json

    from landing_sim.papers import claims, figures, flying, report
    from landing_sim.papers import dickmanns_1992 as chosen

    flown = flying.fly_all(claims.runs_of(chosen.CLAIMS), lambda run: watch(report.told(run)))
    rows = claims.evaluate(chosen.CLAIMS, flown)
    watch("drawing")
    versions = next(iter(flown.values())).log.meta["versions"]
    text = report.html(chosen.TITLE, rows, figures.figures(flown), versions)
    report.write(text, folder / "report.html")
    result = claims.to_json(chosen.NAME, rows)
    report.write(json.dumps(result, indent=1, allow_nan=False) + "\n", folder / "claims.json")
    return Reproduction(result, folder / "report.html")
