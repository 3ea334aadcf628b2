"""Keep a flown campaign's verdict sheet.

usage: tools/sheet DIR... [--commit HASH]

Writes tests/acceptance/CAMPAIGN.json for each folder that `landing-sim campaign` filled: the sheet of `--json`, with the
seed, the commit that flew it (that of the working tree if left out) and the processor time it took. No other run of the
same campaign says anything else but the time.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import accept
import numpy as np

from landing_sim.campaign import rare_landings, sheet, store
from landing_sim.errors import ConfigError


def kept(folder: Path, commit: str) -> dict[str, Any]:
    """What is kept of a campaign. Raises ConfigError where there is none."""
    results, plan = store.read(folder), store.plan(folder)
    found = sheet.sheet(results, folder, rare_landings.saved(folder, plan))
    cpu, memory = results.columns["cpu_s"], results.columns["peak_mb"]
    rare = {
        name: {key: one[key] for key in ("probability", "lower", "upper", "reached", "evaluations", "held")}
        | {"shares": [level["share"] for level in one["levels"]]}
        for name, one in rare_landings.details(folder, plan).items()
    }
    return {
        "name": found.pop("campaign"),
        "campaign": plan.label,
        "scenario": plan.campaign.scenario,
        "seed": plan.campaign.seed,
        "landings": found.pop("runs"),
        "asked": plan.campaign.runs,
        "commit": commit,
        **{key: value for key, value in found.items() if key != "files"},
        **({"rare_events": rare} if rare else {}),
        "cpu_s": {"median": float(np.nanmedian(cpu)), "total": float(np.nansum(cpu))},
        "worker_mb": {"median": float(np.nanmedian(memory)), "max": float(np.nanmax(memory))},
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--commit")
    args = parser.parse_args()
    for folder in args.folder:
        try:
            found = kept(folder, args.commit or accept.commit())
        except ConfigError as error:
            print(error, file=sys.stderr)
            return 2
        path = accept.OUT / f"{found['name']}.json"
        path.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n")
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
