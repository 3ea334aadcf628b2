"""One module a paper: its claims as data, how each is measured, and the paper's value beside ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from landing_sim.papers.paper import Paper

PAPERS = ("dickmanns-1992", "gibert-2015", "sabiron-2014", "brockers-2012")


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What came of a paper: the object `reproduce --json` prints, and the report's path."""

    result: dict[str, Any]
    report: Path


def load(name: str) -> Paper:
    """Raises KeyError if there is no such paper."""
    from landing_sim.papers.paper import Paper

    if name == "dickmanns-1992":
        from landing_sim.papers import dickmanns_1992 as dickmanns
        from landing_sim.papers import dickmanns_figures, flying

        text = (dickmanns.NAME, dickmanns.TITLE, dickmanns.LEAD, dickmanns.FIGURES, "Flights", dickmanns.RUNS)
        return Paper(*text, dickmanns.CLAIMS, flying.fly, dickmanns_figures.figures)
    if name == "gibert-2015":
        from landing_sim.papers import gibert_2015 as gibert
        from landing_sim.papers import gibert_figures

        text = (gibert.NAME, gibert.TITLE, gibert.LEAD, gibert.FIGURES, "Simulations and flights", gibert.RUNS)
        return Paper(*text, gibert.CLAIMS, gibert.perform, gibert_figures.figures)
    if name == "sabiron-2014":
        from landing_sim.papers import sabiron_2014 as sabiron
        from landing_sim.papers import sabiron_figures

        text = (sabiron.NAME, sabiron.TITLE, sabiron.LEAD, sabiron.FIGURES, "Simulations", sabiron.RUNS)
        return Paper(*text, sabiron.CLAIMS, sabiron.perform, sabiron_figures.figures)
    if name == "brockers-2012":
        from landing_sim.papers import brockers_2012 as brockers
        from landing_sim.papers import brockers_figures

        text = (brockers.NAME, brockers.TITLE, brockers.LEAD, brockers.FIGURES, "Flights", brockers.RUNS)
        return Paper(*text, brockers.CLAIMS, brockers.perform, brockers_figures.figures)
    raise KeyError(f"no such paper: {name!r}; there are: {', '.join(PAPERS)}")


def reproduce(paper: str, folder: Path, watch: Callable[[str], None] = lambda line: None) -> Reproduction:
    """Carry out everything the paper's claims need, judge them, write `report.html` and `claims.json` into `folder`.

    watch : is told what starts, a line at a time. Raises KeyError if the paper is not one of PAPERS.
    """
    chosen = load(paper)
    import json

    from landing_sim.papers import claims, report
    from landing_sim.record.log import versions

    results = {}
    for job in claims.runs_of(chosen.claims):
        watch(job.told())
        results[job] = chosen.perform(job)
    rows = claims.evaluate(chosen.claims, results)
    watch("drawing")
    report.write(report.html(chosen, rows, chosen.figures(results), versions()), folder / "report.html")
    result = claims.to_json(chosen.name, rows)
    report.write(json.dumps(result, indent=1, allow_nan=False) + "\n", folder / "claims.json")
    return Reproduction(result, folder / "report.html")
