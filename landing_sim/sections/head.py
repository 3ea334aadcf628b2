"""What every scenario begins with, whatever is flown."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from landing_sim.config import Section


class Head(Section):
    """One flight. Each mission's model says which `mission` it is of."""

    schema_version: Literal[1] = Field(description="version of this format")
    mission: str
    name: str = Field(
        "", max_length=100, pattern=r"^[^/\\\x00-\x1f\x7f]*$", description="short name; the file's own if left out"
    )
    description: str = Field("", max_length=2000, description="what it is for")
    seed: int = Field(1, ge=0, lt=2**63, description="root of all random numbers")
    run: int = Field(0, ge=0, lt=2**32, description="of a campaign: independent random numbers under the same seed")
