"""Campaigns: one scenario flown many times with dispersed values, and what that proves.

    plan.py          what a campaign is: `Campaign`, `Plan`
    file.py          its YAML into a `Plan`, every mistake with its place before anything flies
    dispersions.py   distributions, and the values of run k
    landing.py       one landing: run index (or noise) to a row of figures
    pool.py cluster.py   where landings are flown: local processes, dask
    run.py store.py  fly what is missing; one row a landing in SQLite; `Results`
    worst.py         which variable is worst: each held at its ends in turn
    verdict.py tails.py rare.py sensitivity.py   statistics: pure functions of columns
    sheet.py report.py export.py   what is seen of it     commands.py   the command line

What the statistics may rely on (`store.read(folder) -> Results`):

    columns   name -> (n,) float64, a row a landing in order of "run"; NaN where the flight has no such figure
              every metric of `record.judge.measure` ("touchdown_x_m", "touchdown_y_m", "sink_rate_mps",
              "touchdown_bank_deg", ...), "touchdown_sideslip_deg", "gear_height_60m_m" (lower main wheel over the surface,
              60 m past the threshold), "nees_BAND" for the bands of `plan.NEES_BANDS`, "wall_s", "cpu_s",
              every dispersed value under its path ("wind.crosswind_mps"; words as their index in the choice), every
              variable under its name
    outcome   (n,) str: landed, go_around, crash, off_runway, timeout, numeric_error as `run`; cannot_fly where the aircraft
              has no trim for what was drawn; worker_killed where the landing took its process down twice; error where our
              own code raised (both are flown again when the command is run again)
    dispersed names of the columns that were drawn (not derived from others): what sensitivity explains scatter by
    campaign  plan.Campaign: name, runs, seed, risks, sweep, ...
    meta      JSON values: software, machine, workers, seconds it took

    Risk(name, metric, above, below, probability)   the event is metric > above or metric < below; either may be None.
              A landing that never touched down has no metric: a go-around is no event and not counted in n; any other
              such end (crash, off_runway, timeout, numeric_error, cannot_fly, worker_killed, error) counts as the event.
    Sweep(path, values, ...)   the limit campaign: landing k holds `path` at values[k % len(values)]; columns[path] has it

For rare events `landing.fly(campaign, run, noise)` takes any `noise: Callable[[str], NoiseStream]`: dispersions,
turbulence, sensors, everything that is drawn, are functions of these standard normals, so swapping the handle moves the
whole landing. Dispersions are named "dispersion PATH" and take one normal each.
"""
