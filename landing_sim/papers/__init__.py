"""One module a paper: its claims as data, how each is measured, the paper's value beside ours."""

from __future__ import annotations

PAPERS = {"dickmanns-1992": "landing_sim.papers.dickmanns_1992"}
"""Name on the command line -> module, loaded when it is asked for."""
