"""Starts the rerun viewer. Nothing but this machine can reach what it serves: its own default is every interface."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PATIENCE = 15.0  # [s] for a viewer to come up


class ReplayError(RuntimeError):
    """The recording cannot be written or shown."""


def open_viewer(path: Path, web: bool = False) -> None:
    """Show a recording until the viewer is closed.

    web : serve it to a browser instead of opening a window. Raises ReplayError if it cannot be shown.
    """
    if not path.is_file():
        raise ReplayError(f"{path}: no such recording")
    command = [_program(), "--bind", "127.0.0.1", *(["--web-viewer"] if web else []), str(path)]
    try:
        code = subprocess.run(command, check=False).returncode
    except KeyboardInterrupt:
        return
    if code != 0:
        hint = "" if web else "; without a display, `--web` shows it in a browser"
        raise ReplayError(f"the viewer ended with code {code}{hint}")


def start_live_viewer() -> str:
    """Open a window that outlives this process; the address to stream to. Raises ReplayError if none comes up."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [_program(), "--bind", "127.0.0.1", "--port", str(port)]
    with tempfile.TemporaryFile("w+") as said:  # not a pipe: nobody would empty it once we are gone
        viewer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said, start_new_session=True)
        deadline = time.monotonic() + PATIENCE
        listening = 0
        while time.monotonic() < deadline:
            if viewer.poll() is not None:
                said.seek(0)
                why = said.read().strip().splitlines()[-1:] or [f"code {viewer.returncode}"]
                raise ReplayError(f"no live view, the viewer ended: {why[0]}")
            # It listens before it finds that it has no display: believe it only when it still does a while later.
            try:
                socket.create_connection(("127.0.0.1", port), timeout=0.5).close()
                listening += 1
            except OSError:
                listening = 0
            if listening == 5:
                return f"rerun+http://127.0.0.1:{port}/proxy"
            time.sleep(0.2)
    os.killpg(viewer.pid, signal.SIGTERM)  # the program starts a child
    raise ReplayError(f"no live view: the viewer did not answer within {PATIENCE:g} s")


def _program() -> str:
    beside = Path(sys.executable).with_name("rerun")
    program = str(beside) if beside.exists() else shutil.which("rerun")
    if program is None:
        raise ReplayError("the rerun viewer is missing: install it with `pip install 'rerun-sdk>=0.41,<0.42'`")
    return program
