"""Which variable is worst: every one that a campaign disperses is held at its 1st and 99th percentile in turn.

usage: tools/worst CAMPAIGN [--landings N] [--variable NAME]... [--workers N] [--out DIR]

Flies N landings at each end of each variable into DIR/VARIABLE (out/NAME-worst if left out; the same command goes on), and
prints for each risk where it came nearest: events, and how many standard deviations the metric's mean is from the limit.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from landing_sim.campaign import file
from landing_sim.campaign.worst import Held, worst
from landing_sim.errors import ConfigError


def show(held: Held) -> None:
    print(f"  {held.name} = {held.value:.4g}: {held.count} of {held.n}, {held.sigmas:.1f} sigma from the limit")


def told(name: str, values: tuple[float, ...]) -> None:
    print(f"holding {name} at {', '.join(f'{value:.4g}' for value in values)}", file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaign")
    parser.add_argument("--landings", type=int, default=50, help="at each end of each variable")
    parser.add_argument("--variable", action="append", help="drawn name or path; all if left out")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    try:
        plan = file.load(args.campaign)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    unknown = set(args.variable or []) - set(plan.campaign.drawn())
    if unknown:
        parser.error(f"not drawn: {', '.join(sorted(unknown))}; there are: {', '.join(plan.campaign.drawn())}")
    folder = args.out or Path("out") / f"{plan.campaign.name}-worst"
    try:
        found = worst(plan, folder, args.landings, args.variable, args.workers, told)
    except (ConfigError, ValueError) as error:  # a folder of another campaign, a choice of words
        print(error, file=sys.stderr)
        return 2
    for risk in plan.campaign.risks:
        print(f"{risk.name}: {risk.metric}")
        for held in [h for h in found if h.risk == risk.name][:5]:
            show(held)
    return 0


if __name__ == "__main__":
    sys.exit(main())
