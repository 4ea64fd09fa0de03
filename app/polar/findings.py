"""What polar alignment has to say beside its numbers."""

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """What a finding is about; the fixed list."""

    SMALL_TURN = "turn too small"
    ALIKE = "frames too alike"
    LOW = "frame too low"
    DEC_MOVED = "declination moved"
    CAMERA_TURNED = "camera turned in its holder"
    DISAGREE = "frames do not share one axis"
    RESTLESS = "residuals larger than noise"
    UNCHECKED = "two frames only"
    SLIPPING = "clutch slips"
    FLEXURE = "flexure"
    UNSEEN_FLEXURE = "flexure not seen"
    DROOP = "tube droops"
    SITE_OR_TIME = "site or time implausible"
    FAR = "far from the pole"
    POLE = "which pole"
    DONE = "error below its uncertainty"
    REMEASURE = "measure again"


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence for the person, and what it is about."""

    kind: Kind
    text: str
