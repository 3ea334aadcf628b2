"""A guidance signal that is off: the line that guidance takes for the centreline lies beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from landing_sim.interfaces import Guidance
from landing_sim.signals import Estimate, Reference


@dataclass(frozen=True, slots=True)
class OffsetGuidance:
    """interfaces.Guidance around another: lands it `offset` [m] right of where it would.

    An instrument landing system's localizer may be centred that far beside the runway; here it is a line on the map that
    is wrong by as much, at any range.
    """

    guidance: Guidance
    offset: float

    def init(self) -> Any:
        return self.guidance.init()

    def step(self, memory: Any, estimate: Estimate) -> tuple[Any, Reference]:
        mean = estimate.mean.copy()
        mean[estimate.names.index("y")] -= self.offset
        memory, reference = self.guidance.step(memory, replace(estimate, mean=mean))
        return memory, replace(reference, y=reference.y + self.offset)
