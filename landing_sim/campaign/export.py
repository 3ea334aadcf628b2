"""A campaign's rows for other programs: CSV and Parquet, one a landing, a column a figure, empty where there is none."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from landing_sim.campaign import store
from landing_sim.errors import ConfigError, Mark, Problem


def export(folder: Path, csv: Path | None, parquet: Path | None) -> Iterator[Path]:
    """Write them and say which are written. Raises CampaignError where there are none, ConfigError where it cannot."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet

    results = store.read(folder)
    columns: dict[str, Any] = {"run": pa.array(results.columns["run"].astype("int64"))}
    columns["outcome"] = pa.array(results.outcome.tolist(), pa.string())
    for name, values in results.columns.items():
        if name != "run":
            columns[name] = pa.array(values, from_pandas=True)  # NaN is null
    for name, distribution in results.campaign.drawn().items():
        choice = distribution.choice
        if choice is not None and any(isinstance(value, str) for value in choice.values):
            words = [None if value != value else choice.values[int(value)] for value in results.columns[name]]
            columns[name] = pa.array([None if word is None else str(word) for word in words], pa.string())
    table = pa.table(columns)
    for path, write in ((csv, pyarrow.csv.write_csv), (parquet, pyarrow.parquet.write_table)):
        if path is None:
            continue
        try:
            _whole(path, table, write)
        except OSError as error:
            raise ConfigError([Problem(Mark(str(path)), (), f"cannot be written: {error.strerror}")]) from None
        yield path


def _whole(path: Path, table: Any, write: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        write(table, temporary)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
