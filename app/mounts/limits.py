"""What a guarded mount may do, and the evidence a sync must bring."""

from dataclasses import dataclass

from app.core.solution import Solution


@dataclass(frozen=True, slots=True)
class Limits:
    """The guard's numbers. A fork or alt-azimuth mount ``crosses_meridian`` without a flip.

    Hour angles are not limited by themselves: a German mount chooses the side of its pier in a
    slew, so the same hour angle may be safe on one side and not on the other, and a fork reaches
    them all. What does not flip, a move of the axis, is kept near the meridian where the mount
    tells its side.
    """

    lowest_altitude_deg: float = 5.0
    highest_altitude_deg: float = 90.0
    hour_angle_deg: tuple[float, float] = (-180.0, 180.0)  # only its owner knows where the pier is
    past_meridian_deg: float = 15.0  # for a move of the axis, which never flips
    allow_without_site: bool = False

    longest_slew_deg: float = 120.0
    slew_timeout_s: float = 240.0
    slew_start_s: float = 30.0  # a slew takes no longer than this and its angle at the slowest rate
    slowest_slew_deg_s: float = 0.25
    allow_flip: bool = False
    crosses_meridian: bool = False

    longest_move_s: float = 60.0
    longest_move_deg: float = 95.0
    longest_pulse_ms: int = 5000

    sun_cone_deg: float = 30.0
    sun_up_deg: float = -10.0

    confirm_sync_deg: float = 5.0
    refuse_sync_deg: float = 20.0
    solves_agree_arcsec: float = 120.0
    worst_rms_px: float = 2.0
    worst_log10_false_alarm: float = -5.0  # as the solver; two that agree make it 10^-10
    read_back_arcsec: float = 120.0  # the coarsest mounts round to 90
    near_pole_deg: float = 85.0


@dataclass(frozen=True, slots=True)
class SyncEvidence:
    """What independent solves say: one entry a solve in every tuple, centres in ICRS degrees."""

    centres_deg: tuple[tuple[float, float], ...]
    rms_px: tuple[float, ...]
    log10_false_alarm: tuple[float, ...]

    @classmethod
    def of(cls, *solutions: Solution) -> "SyncEvidence":
        """The evidence of solved frames, each of another exposure."""
        return cls(
            tuple(s.ra_dec_deg for s in solutions),
            tuple(s.rms_px for s in solutions),
            tuple(s.log10_false_alarm for s in solutions),
        )
