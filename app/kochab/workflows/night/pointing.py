"""The night's pointing model and the tube's flexure: where frames point against where their headers have the mount.

Frames of one place say one thing; a model needs several. The headers' places may be of J2000, as the standard has it,
or of date, as many mounts speak: the one that makes the better model is taken, if it is clearly better; else what the
header says.
"""

from collections.abc import Sequence

import numpy as np

from kochab.core.attitude import Degrees, apart_deg
from kochab.core.errors import RefusedError
from kochab.core.mount import Epoch, Pointing
from kochab.core.values import frozen
from kochab.pointing.disagreement import MountSighting
from kochab.pointing.flexure import tube_droop
from kochab.pointing.pointing_model import FARTHEST_DEG, PointingModel, fit_model
from kochab.sky.horizon import sidereal_deg
from kochab.text.translation import number, tr, tr_noop
from kochab.workflows.night.backlash import COPIED_ARCSEC
from kochab.workflows.night.frame import NightFrame
from kochab.workflows.night.measure import Measure

PLACES_DEG = 5.0
"""Frames farther apart than this in hour angle and declination count as different places."""
FEWEST_PLACES, WORTH = 6, 0.7
"""A model is used that foretells new places to this share of how far they are off without it. Of nights in which the
mount was synced at every place, so that nothing is left but noise, 1 in 25 of four or five places looked like one."""
EQUATORIAL = 0.9
"""Length of the mean of unit vectors at twice the position angle: a camera on an equatorial mount keeps its angle, and
is upside down on the other side of the pier."""
CLEARLY = 1.5
"""An equinox is chosen where its model foretells places so many times better than the other's."""
DROOP_ARCSEC = 30.0
"""What tubes commonly sag by: a flexure is told that is surer than this, or surely none."""


FEW = tr_noop("too few places")


@frozen
class NightPointing:
    """The pointing model and the sightings it was fitted to; without one, ``why`` there is none.

    ``droop`` is how much further the tube sags at the horizon than at the zenith, arcsec, as far as the sightings show.
    """

    model: PointingModel | None
    sightings: tuple[MountSighting, ...] = ()
    why: str = ""
    droop: Measure | None = None

    @property
    def useful_sightings(self) -> tuple[MountSighting, ...]:
        """Those by which gotos are better than without."""
        one = self.model
        return self.sightings if one is not None and one.foretold_arcsec < WORTH * one.before_arcsec else ()

    @property
    def flexure(self) -> Measure | None:
        """The droop where it tells more than what tubes do anyway."""
        return self.droop if self.droop and self.droop.tells(DROOP_ARCSEC) else None

    @property
    def flexure_words(self) -> str:
        """The flexure of the tube, or why it is not known."""
        if self.flexure:
            return tr("Tube flexure: {droop}″ from zenith to horizon.", droop=self.flexure.text("+"))
        if self.droop:
            sigma = number(self.droop.sigma, ".0f")
            return tr("Tube flexure unknown (±{sigma}″): it needs more places, low ones too.", sigma=sigma)
        return tr("Tube flexure unknown: {why}.", why=tr(self.why or FEW).rstrip("."))

    def lines(self) -> list[str]:
        """Each term with its sigma, and what the model is worth, or why there is none; and the flexure."""
        if self.model is not None:
            return [*self.model.lines(), self.flexure_words]
        return [tr("Pointing model and tube flexure unknown: {why}.", why=tr(self.why).rstrip("."))]


NO_POINTING = NightPointing(None)


def pointing_of(frames: Sequence[NightFrame]) -> NightPointing:
    """What frames in order of time, with their headers' word, say of the mount's axes."""
    known = [f for f in frames if f.solved and f.time_utc and f.site and f.reported_deg]
    if not known:
        return _unknown(tr_noop("no header has the mount's position, the time and the site"))
    off_deg = [apart_deg((f.ra_deg, f.dec_deg), f.reported_deg) for f in known if f.reported_deg]
    if float(np.median(off_deg)) < COPIED_ARCSEC / 3600.0:
        return _unknown(tr_noop("the headers repeat the solution, not the mount's own place"))
    if float(np.median(off_deg)) > FARTHEST_DEG:
        return _unknown(tr_noop("the headers give another place than the frames show"))
    places = _places(known)
    if len(places) < FEWEST_PLACES:
        return _unknown(tr_noop("at least six places far from each other are needed"))
    twice = 2.0 * np.radians([f.roll_deg for f in places])
    if np.hypot(np.cos(twice).mean(), np.sin(twice).mean()) < EQUATORIAL:
        return _unknown(tr_noop("the camera turned between places, as on a mount that is not equatorial"))
    sightings = {epoch: [_sighting(f, epoch) for f in places] for epoch in Epoch}
    try:
        models = sorted((fit_model(seen) for seen in sightings.values()), key=lambda model: model.foretold_arcsec)
    except RefusedError as error:
        return _unknown(str(error))
    best, other = models
    if best.helps and other.foretold_arcsec < CLEARLY * best.foretold_arcsec:
        # within an hour precession looks like a lean of the axis
        if places[0].epoch is None:
            return _unknown(tr_noop("the headers do not say whether their places are J2000"))
        best = best if best.epoch is places[0].epoch else other
    used = sightings[best.epoch]
    droop = tube_droop(used, best)
    return NightPointing(best, tuple(used), droop=Measure(*droop) if droop else None)


def _unknown(why: str) -> NightPointing:
    return NightPointing(None, why=why)


def _places(frames: Sequence[NightFrame]) -> list[NightFrame]:
    """The first frame of each place that the axes stood at."""
    kept: dict[Degrees, NightFrame] = {}
    for f in frames:
        assert f.site is not None
        assert f.time_utc is not None
        here = (f.ra_deg - sidereal_deg(f.site, f.time_utc), f.dec_deg)
        if all(apart_deg(here, there) > PLACES_DEG for there in kept):
            kept[here] = f
    return list(kept.values())


def _sighting(f: NightFrame, epoch: Epoch) -> MountSighting:
    """A frame as a sighting, its header's place taken to be of that equinox."""
    assert f.reported_deg is not None
    assert f.time_utc is not None
    reported = Pointing(*f.reported_deg, epoch)
    return MountSighting((f.ra_deg, f.dec_deg), reported, f.time_utc, f.site, f.pier_side, alt_azimuth=False)
