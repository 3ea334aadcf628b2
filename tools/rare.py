"""Rare events of a campaign, on the real loop.

usage: tools/rare CAMPAIGN [--risk NAME]... [--landings N] [--share P] [--workers N] [--held VALUE] [--out DIR]
       tools/rare CAMPAIGN --risk NAME --agree N     subset simulation against N plain landings, both flown here
       tools/rare CAMPAIGN --risk NAME --falsify     the mildest gust that breaks the limit in run 0

The first form adds what it finds to DIR/rare.json (DIR: the campaign's folder, out/NAME): `landing-sim campaign` and
`report` take it up in their verdicts. Exit status 1 where the two intervals of --agree do not meet, 2 for what cannot be
asked, 3 where a simulation cannot go on.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import time
from pathlib import Path

import numpy as np

from landing_sim.campaign import file
from landing_sim.campaign.falsify import falsify
from landing_sim.campaign.plan import Plan, Risk
from landing_sim.campaign.rare import Estimate, Level, RareError, simulate
from landing_sim.campaign.rare_landings import Landings, Links, aimed, gust_margin, save
from landing_sim.campaign.verdict import count_bounds
from landing_sim.errors import ConfigError


def told(level: Level) -> None:
    print(f"  level at {level.threshold:.4g}: share {level.share:.3f}, {level.evaluations} landings", flush=True)


def show(estimate: Estimate[Links]) -> None:
    print(
        f"  P = {estimate.probability:.3g} [{estimate.lower:.2g} ... {estimate.upper:.2g}], {estimate.evaluations} landings"
    )


def agree(space: Landings, estimate: Estimate[Links], n: int) -> bool:
    """Plain landings of the same campaign, none of which the subset simulation flew, against its interval."""
    plain = [((1_000_000 + k, 0.0),) for k in range(n)]
    hits = int(np.sum(space.performance(plain) > 0.0))
    bounds = count_bounds(hits, n)
    print(f"  {hits} of {n} plain landings: {bounds.estimate:.3g} [{bounds.lower:.2g} ... {bounds.upper:.2g}]")
    return bounds.lower <= estimate.upper and estimate.lower <= bounds.upper


def mildest(plan: Plan, risk: Risk, run: int, largest: float, folder: Path) -> None:
    """The falsifier's answer, and how to watch it."""
    start = float(plan.scenario["initial"]["x_m"])
    places = np.linspace(0.5 * start, 200.0, 5).tolist()
    found = falsify(gust_margin(plan, risk, run), places, [30.0, 100.0, 250.0], largest)
    if found.gust is None:
        print(
            f"  no gust up to {largest:g} m/s breaks it: {-found.margin:.3g} short, {found.flights} flights", flush=True
        )
        return
    print(f"  {found.gust.words()} breaks it, by {found.margin:.2g}; {found.flights} flights")
    (change,) = found.gust.changes()
    print(f"  landing-sim replay {shlex.quote(str(folder))} --run {run} --set {shlex.quote(change)}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign")
    parser.add_argument("--risk", action="append", help="name of a risk; all if left out")
    parser.add_argument("--landings", type=int, default=1000, help="a level")
    parser.add_argument("--share", type=float, default=0.1, help="of them that go on to the next level")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--held", type=float, help="the sweep's value; the one it aims at if left out")
    parser.add_argument("--agree", type=int, metavar="N")
    parser.add_argument("--falsify", action="store_true")
    parser.add_argument("--largest", type=float, default=15.0, help="m/s, of the gusts tried")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    try:
        plan = file.load(args.campaign)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    risks = [risk for risk in plan.campaign.risks if not args.risk or risk.name in args.risk]
    if len(risks) < len(args.risk or [1]):
        parser.error(f"its risks are: {', '.join(risk.name for risk in plan.campaign.risks)}")
    sweep = plan.campaign.sweep
    held = aimed(plan) if args.held is None else args.held
    if held is not None and (sweep is None or held not in sweep.values):
        parser.error(f"--held {held:g} is none of the sweep's values")
    run = 0 if sweep is None or held is None else sweep.values.index(held)
    folder = args.out or Path("out") / plan.campaign.name
    good = True
    for risk in risks:
        print(f"{plan.campaign.name}: {risk.name}", flush=True)
        if args.falsify:
            mildest(plan, risk, run, args.largest, folder)
            continue
        began = time.monotonic()
        space = Landings(plan, risk, args.workers, run)
        try:
            estimate = simulate(space, args.landings, args.share, told=told)
        except ValueError as error:
            parser.error(str(error))
        except RareError as error:
            print(f"  {error}", file=sys.stderr)
            return 3
        show(estimate)
        if args.agree:
            good &= agree(space, estimate, args.agree)
        else:
            print(f"  {save(folder, plan, risk, estimate, held=held, seconds=time.monotonic() - began)}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
