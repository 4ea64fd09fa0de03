"""What may be chosen about following one camera."""

from dataclasses import dataclass, field

from app.attitude.filter import Motion
from app.solve.options import SolveOptions


@dataclass(frozen=True, slots=True)
class TrackOptions:
    """Choices for a stream: how a lost frame is solved, how the camera is believed to move.

    ``stars`` are looked for at most, in windows of up to ``half_px`` to each side, and of up to
    ``far_px`` when the prediction is less certain than that. A pointing that is ``memory_s`` old is
    no prediction any more. Every ``calibrate_every`` frames the camera's profile is improved by
    what the stars say; 0 leaves it at what the first frame said.
    """

    solve: SolveOptions = field(default_factory=SolveOptions)
    motion: Motion = field(default_factory=Motion)
    stars: int = 40
    half_px: int = 32
    far_px: int = 64
    memory_s: float = 900.0
    calibrate_every: int = 10
