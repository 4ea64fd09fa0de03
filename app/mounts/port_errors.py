"""Why a port cannot be opened, and exactly what to do about it."""

import errno
import os
import sys
from pathlib import Path
from urllib.parse import urlsplit

from app.core.errors import PortError

BUSY = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)


def not_opened(port: str, error: Exception) -> PortError:
    """The `PortError` for what pyserial raised on opening ``port``."""
    if port.startswith("socket://"):
        return PortError(_server(port, error))
    if "://" in port:
        return PortError(f"{port} is not a port: give a device, COM3 or socket://HOST:PORT.")
    number = getattr(error, "errno", None)
    text = str(error).lower()
    if number in (errno.EACCES, errno.EPERM) and sys.platform != "win32":
        return PortError(_permission(port))
    if number in BUSY or "access is denied" in text or "exclusively lock" in text:
        return PortError(f"{port} is in use: close the other program that talks to this mount.")
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV) or "filenotfound" in text:
        return PortError(_absent(port))
    return PortError(f"{port} cannot be used as a serial port.")


def _server(port: str, error: Exception) -> str:
    if not _is_address(port):
        return f"{port} is not an address: write it as socket://HOST:PORT."
    if "refused" in str(error).lower():
        return f"Nothing listens at {port}: check the address and that the mount's bridge is on."
    return f"{port} cannot be reached: check the address and the network."


def _is_address(port: str) -> bool:
    try:
        parts = urlsplit(port)
        return bool(parts.hostname) and parts.port is not None
    except ValueError:
        return False


def _permission(port: str) -> str:
    group = _group(port)
    if group in ("", "root"):
        return f"You may not open {port}: ask the administrator of this computer for access to it."
    return (
        f"You may not open {port}, it belongs to the group {group}: "
        f"run `sudo usermod -aG {group} $USER` and log in again."
    )


def _group(port: str) -> str:
    """The group that owns the device, ``dialout`` on Debian, ``uucp`` or ``plugdev`` elsewhere."""
    try:
        import grp

        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return ""


def _absent(port: str) -> str:
    if port.startswith("/dev/") or port.upper().startswith("COM"):
        return f"There is no {port}: plug in the USB cable and switch the mount on."
    where = "" if Path(port).parent.is_dir() else ", nor its folder"
    return f"There is no port {port}{where}: `kochab mount list` shows those there are."
