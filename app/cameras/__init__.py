"""Devices that give frames, behind one small interface (:mod:`app.core.capture`)."""

SOURCES: dict[str, str] = {}
