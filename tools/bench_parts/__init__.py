"""Parts of tools/bench.py: each measures one thing and returns plain figures."""
