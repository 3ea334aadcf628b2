"""Results of a campaign: one row a landing in SQLite, written by one process, each row for good before the next.

campaign   key, value: the plan, its identity
landings   run, outcome, reason, figures, values: the same bits whoever flew it, and however often it was interrupted
effort     run, wall_s, cpu_s, peak_mb, worker: what it took
sessions   when, where, with what software, how many workers: one row each time the command was run
histories/run-000417.parquet   the log of landing 417, if it is kept
"""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_sim.campaign.machine import software, this_machine
from landing_sim.campaign.plan import Campaign, CampaignError, Plan
from landing_sim.errors import Mark, Problem
from landing_sim.types import Array

FILE = "campaign.sqlite"
HISTORIES = "histories"
VERSION = 1
AGAIN = ("worker_killed", "error")
"""Outcomes that say nothing of the aircraft: flown again when the command is run again."""
_EFFORT = ("wall_s", "cpu_s", "peak_mb", "worker")


@dataclass(frozen=True, slots=True)
class Results:
    """What was flown, as columns in order of run. See `landing_sim.campaign`."""

    campaign: Campaign
    columns: Mapping[str, Array]  # (n,) float64 each
    outcome: np.ndarray  # (n,) str
    dispersed: tuple[str, ...]  # columns that were drawn
    reasons: Mapping[int, str]  # of outcomes that figures do not explain, by run
    meta: Mapping[str, Any]  # sessions: what it ran on and how long it took

    def __len__(self) -> int:
        return len(self.outcome)


class Store:
    """The results of one folder, open for writing; `with` closes it. Raises CampaignError where it cannot be used."""

    def __init__(self, folder: Path, plan: Plan, figures: tuple[str, ...]) -> None:
        self.folder, self._figures = folder, figures
        self._values = tuple(plan.campaign.names())
        _check_folder(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(folder)
            self._db = sqlite3.connect(folder / FILE)
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
            self._open(plan)
        except (OSError, sqlite3.Error) as error:
            raise _refused(folder, f"cannot be used: {error}") from None
        for left in (folder / HISTORIES).glob(".run-*"):  # of a process that was killed
            left.unlink()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()
        self._lock.close()

    def _open(self, plan: Plan) -> None:
        identity = {"version": VERSION, "campaign": plan.identity(), "columns": [*self._figures, *self._values]}
        found = _meta(self._db)
        if found and found.get("identity") != identity:
            message = "holds another campaign, or one whose scenario, aircraft or columns have changed since"
            raise _refused(self.folder, f"{message}: name another folder with --out, or remove it")
        with self._db:
            self._db.execute("CREATE TABLE IF NOT EXISTS campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL)")
            text = "run INTEGER PRIMARY KEY, outcome TEXT NOT NULL, reason TEXT NOT NULL"
            columns = ", ".join(f"{_quoted(name)} REAL" for name in self._figures)
            values = ", ".join(_quoted(name) for name in self._values)  # words stay words
            self._db.execute(
                f"CREATE TABLE IF NOT EXISTS landings ({', '.join(filter(None, (text, columns, values)))})"
            )
            self._db.execute(
                "CREATE TABLE IF NOT EXISTS effort "
                "(run INTEGER PRIMARY KEY, wall_s REAL, cpu_s REAL, peak_mb REAL, worker TEXT)"
            )
            self._db.execute("CREATE TABLE IF NOT EXISTS sessions (id INTEGER PRIMARY KEY, value TEXT NOT NULL)")
            written = {
                "identity": identity,
                "plan": {
                    "campaign": plan.campaign.model_dump(mode="json"),
                    "scenario": plan.scenario,
                    "label": plan.label,
                },
            }
            for key, value in written.items():
                self._db.execute("INSERT OR REPLACE INTO campaign VALUES (?, ?)", (key, json.dumps(value)))

    def missing(self, runs: int) -> list[int]:
        """What of 0 ... runs - 1 is still to be flown."""
        done = {
            run
            for run, outcome in self._db.execute("SELECT run, outcome FROM landings")
            if outcome not in AGAIN
        }  # fmt: skip
        return [run for run in range(runs) if run not in done]

    def add(self, landing: Any) -> None:
        """One row, in place of what stood there. `landing` is a `landing.Landing`."""
        if landing.history is not None:
            self._keep(landing.run, landing.history)
        figures, values = landing.figures or {}, landing.values or {}
        row = [landing.run, landing.outcome, landing.reason]
        row += [_finite(figures.get(name)) for name in self._figures] + [values.get(name) for name in self._values]
        effort = [landing.run, *(_finite(getattr(landing, name)) for name in _EFFORT)]
        with self._db:
            for table, cells in (("landings", row), ("effort", effort)):
                marks = ", ".join("?" * len(cells))
                self._db.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", cells)

    def _keep(self, run: int, history: bytes) -> None:
        folder = self.folder / HISTORIES
        folder.mkdir(exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=folder, prefix=f".run-{run:06d}.")
        with os.fdopen(handle, "wb") as stream:
            stream.write(history)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, folder / f"run-{run:06d}.parquet")

    @contextlib.contextmanager
    def session(self, **what: Any) -> Iterator[None]:
        """A row of `sessions`, its length kept up to date at the end, however that comes about but by a kill."""
        started = time.time()
        value = {"started": started, "machine": this_machine(), "software": software(), "seconds": None, **what}
        with self._db:
            at = self._db.execute("INSERT INTO sessions (value) VALUES (?)", (json.dumps(value),)).lastrowid
        before = self._flown()
        try:
            yield
        finally:
            value |= {"seconds": time.time() - started, "landings": self._flown() - before}
            with self._db:
                self._db.execute("UPDATE sessions SET value = ? WHERE id = ?", (json.dumps(value), at))

    def _flown(self) -> int:
        return int(self._db.execute("SELECT COUNT(*) FROM landings").fetchone()[0])


def read(folder: Path) -> Results:
    """Everything flown so far, also while it is being flown. Raises CampaignError where there is none."""
    with _reading(folder) as db:
        meta, plan = _meta(db), _plan(folder, db)
        table = db.execute(
            f"SELECT landings.*, {', '.join(_EFFORT)} FROM landings LEFT JOIN effort USING (run) ORDER BY run"
        )
        names = [column[0] for column in table.description]
        rows = [row for row in table if row[0] < plan.campaign.runs]
        sessions = [json.loads(value) for (value,) in db.execute("SELECT value FROM sessions ORDER BY id")]
    cells = dict(zip(names, zip(*rows))) if rows else dict.fromkeys(names, ())
    choices = {name: d.choice.values for name, d in plan.campaign.drawn().items() if d.choice is not None}
    columns = {
        name: _floats(cells[name], choices.get(name))
        for name in names
        if name not in ("outcome", "reason", "worker")
    }  # fmt: skip
    return Results(
        plan.campaign,
        columns,
        np.array(cells["outcome"], dtype=str),
        tuple(plan.campaign.drawn()),
        {run: reason for run, reason in zip(cells["run"], cells["reason"]) if reason},
        {"sessions": sessions, "label": plan.label, "identity": meta["identity"]},
    )


def plan(folder: Path) -> Plan:
    """The plan that a folder's landings were flown from. Raises CampaignError where there is none."""
    with _reading(folder) as db:
        return _plan(folder, db)


def is_campaign(folder: Path) -> bool:
    return (folder / FILE).is_file()


def _plan(folder: Path, db: sqlite3.Connection) -> Plan:
    try:
        found = _meta(db)["plan"]
        return Plan(Campaign.model_validate_json(json.dumps(found["campaign"])), found["scenario"], found["label"])
    except (KeyError, ValueError) as error:
        raise _refused(folder, f"its {FILE} is of another version of landing-sim: {error}", "") from None


@contextlib.contextmanager
def _reading(folder: Path) -> Iterator[sqlite3.Connection]:
    if not is_campaign(folder):
        raise _refused(folder, f"holds no {FILE}: `landing-sim campaign` writes one", "")
    db = sqlite3.connect(f"{(folder / FILE).resolve().as_uri()}?mode=ro", uri=True)
    try:
        yield db
    except sqlite3.Error as error:
        raise _refused(folder, f"its {FILE} cannot be read: {error}", "") from None
    finally:
        db.close()


def _meta(db: sqlite3.Connection) -> dict[str, Any]:
    if not db.execute("SELECT name FROM sqlite_master WHERE name = 'campaign'").fetchone():
        return {}
    return {key: json.loads(value) for key, value in db.execute("SELECT key, value FROM campaign")}


def _floats(cells: tuple[Any, ...], choice: tuple[Any, ...] | None) -> Array:
    if choice is not None and not all(isinstance(value, int | float) for value in choice):
        cells = tuple(None if cell is None else choice.index(cell) for cell in cells)
    return np.array([np.nan if cell is None else cell for cell in cells], dtype=float)


def _finite(value: Any) -> Any:
    """NaN is NULL: SQLite knows none."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _check_folder(folder: Path) -> None:
    if os.path.lexists(folder) and not folder.is_dir():
        raise _refused(folder, "is a file, not a folder" if folder.exists() else "is a link to nowhere")
    if folder.is_dir() and not is_campaign(folder) and any(not p.name.startswith(".") for p in folder.iterdir()):
        raise _refused(folder, "is not empty and holds no campaign: name another folder, or empty it")


def _locked(folder: Path) -> Any:
    """Held until it is closed or the process ends, however it ends; workers do not inherit it."""
    stream = (folder / ".lock").open("w")
    with contextlib.suppress(ImportError):  # where there is none, SQLite's own lock still keeps rows whole
        import fcntl

        try:
            fcntl.lockf(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            stream.close()
            raise _refused(folder, "another campaign is being flown there right now") from None
    return stream


def _refused(folder: Path, message: str, option: str = "--out ") -> CampaignError:
    return CampaignError([Problem(Mark(f"{option}{folder}"), (), message)])


__all__ = ["AGAIN", "FILE", "Results", "Store", "is_campaign", "plan", "read"]
