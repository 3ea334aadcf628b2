"""Logs as Parquet files. The same log gives the same bytes."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path

import numpy as np

from landing_sim.record.log import FlightLog, LogError


def write(log: FlightLog, path: Path) -> None:
    """Parquet with the metadata in its schema, written beside `path` and moved there whole."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays, names = [], []
    for name, column in sorted(log.columns.items()):
        if column.ndim == 2:
            flat = pa.array(np.ascontiguousarray(column).reshape(-1))
            arrays.append(pa.FixedSizeListArray.from_arrays(flat, column.shape[1]))
        else:
            arrays.append(pa.array(column))
        names.append(name)
    meta = json.dumps(dict(log.meta), sort_keys=True, allow_nan=False, default=str)
    table = pa.table(arrays, names=names).replace_schema_metadata({"landing_sim": meta})
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        pq.write_table(table, temporary, compression="zstd")
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read(path: Path) -> FlightLog:
    """A stored log. Raises LogError if the file is something else."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise LogError(f"{path}: not a readable Parquet file ({error})") from error
    meta = (table.schema.metadata or {}).get(b"landing_sim")
    if meta is None:
        raise LogError(f"{path}: a Parquet file, but not one of landing-sim's logs")
    columns = {}
    for name in table.column_names:
        column = table.column(name).combine_chunks()
        if pa.types.is_fixed_size_list(column.type):
            flat = column.flatten().to_numpy(zero_copy_only=False)
            columns[name] = flat.reshape(len(table), column.type.list_size)
        else:
            columns[name] = column.to_numpy(zero_copy_only=False)
    if "mode" in columns:
        columns["mode"] = columns["mode"].astype(str)
    return FlightLog(columns, json.loads(meta))
