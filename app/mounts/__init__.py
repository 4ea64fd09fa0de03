"""Telescope mounts over a serial line: link, protocol, driver and guard, each apart."""

DRIVERS: dict[str, str] = {}
