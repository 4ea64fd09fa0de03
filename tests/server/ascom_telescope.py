"""A telescope as an ASCOM driver is one: a COM server in a process of its own, registered for this person (Windows).

``python ascom_telescope.py SITE-PACKAGES -Embedding`` is what COM starts; it ends with its last client. Written after
ASCOM's ``ITelescopeV3`` and its error codes, on pywin32, of which the bridge knows nothing.
"""

import contextlib
import os
import site
import sys
import threading
import time
from pathlib import Path

PROGID = "KochabTest.Telescope"
CLSID = "{6A1B0C52-7C0B-4C67-9B2E-6B0C5A1D7E01}"
NOT_IMPLEMENTED, INVALID_VALUE, NOT_CONNECTED = 0x80040400 - 2**32, 0x80040401 - 2**32, 0x80040407 - 2**32
DEG_S = 8.0


@contextlib.contextmanager
def registered(packages):
    """Registers the driver with Windows for the test; ``packages`` is the folder that pywin32 is in."""
    import winreg

    # Wine looks for classes among those of the machine alone; on Windows these would need an administrator.
    root = winreg.HKEY_LOCAL_MACHINE if "KOCHAB_WINE" in os.environ else winreg.HKEY_CURRENT_USER
    classes, command = r"Software\Classes", f'"{sys.executable}" "{Path(__file__).resolve()}" "{packages}"'
    rows = {
        rf"{classes}\{PROGID}": "A telescope for tests",
        rf"{classes}\{PROGID}\CLSID": CLSID,
        rf"{classes}\CLSID\{CLSID}": "A telescope for tests",
        rf"{classes}\CLSID\{CLSID}\LocalServer32": command,
        rf"{classes}\CLSID\{CLSID}\ProgID": PROGID,
        # pywin32's own: which class, and that it answers by names.
        rf"{classes}\CLSID\{CLSID}\PythonCOM": "ascom_telescope.Telescope",
        rf"{classes}\CLSID\{CLSID}\PythonCOMPolicy": "win32com.server.policy.DynamicPolicy",
    }
    for key, value in rows.items():
        winreg.SetValue(root, key, winreg.REG_SZ, value)
    try:
        yield
    finally:
        for key in sorted(rows, key=len, reverse=True):
            with contextlib.suppress(OSError):
                winreg.DeleteKey(root, key)


def serve(packages):
    """Until the last client is gone, and no longer than two minutes."""
    site.addsitedir(packages)  # pywin32 finds its libraries by a .pth file
    import pythoncom
    import pywintypes
    import win32api
    from win32com.server import factory, util
    from win32com.server.exception import COMException

    class Rates:
        _public_methods_ = ("Item",)
        _public_attrs_ = ("Count",)
        Count = 2

        def Item(self, n):  # noqa: N802
            return (0, 2)[n - 1]  # sidereal and solar

    class Telescope:
        FIXED = {  # noqa: RUF012
            "name": "COM telescope",
            "alignmentmode": 2,
            "equatorialsystem": 1,
            "interfaceversion": 3,
            **dict.fromkeys(("cansync", "canslew", "canslewasync", "cansettracking"), True),
            **dict.fromkeys(("canpulseguide", "atpark", "athome"), False),
            "siteelevation": 100.0,
        }

        def __init__(self):
            self.own = {"connected": False, "tracking": True, "trackingrate": 0}
            self.own |= {"sitelatitude": 48.0, "sitelongitude": 11.0}
            self.here, self.target, self.since = (5.5, 20.0), (5.5, 20.0), 0.0

        def _dynamic_(self, name, lcid, flags, args):
            name = name.lower()
            if flags & (pythoncom.DISPATCH_PROPERTYPUT | pythoncom.DISPATCH_PROPERTYPUTREF):
                if name not in self.own:
                    raise COMException(description=f"{name} cannot be written", scode=NOT_IMPLEMENTED)
                self.own[name] = args[0]
                return None
            if name in ("connected", "name"):
                return self.own.get(name, self.FIXED.get(name))
            if not self.own["connected"]:
                raise COMException(description="Connect first", scode=NOT_CONNECTED)
            if name in self.FIXED or name in self.own:
                return self.FIXED.get(name, self.own.get(name))
            return self._act(name, args)

        def _act(self, name, args):
            ra, dec, slewing = self._now()
            match name:
                case "rightascension":
                    return ra
                case "declination":
                    return dec
                case "slewing":
                    return slewing
                case "trackingrates":
                    return util.wrap(Rates())
                case "utcdate":
                    return pywintypes.Time(time.time())
                case "abortslew":
                    self.here = self.target = (ra, dec)
                case "slewtocoordinatesasync" | "synctocoordinates":
                    if not (0.0 <= args[0] < 24.0 and -90.0 <= args[1] <= 90.0):
                        raise COMException(description="That is no place on the sky.", scode=INVALID_VALUE)
                    self.target = args[:2]
                    self.here = self.target if name.startswith("sync") else (ra, dec)
                    self.since = time.monotonic()
                case "destinationsideofpier":
                    return 1
                case "exit":
                    os._exit(0)
                case _:
                    raise COMException(description=f"{name} is not implemented", scode=NOT_IMPLEMENTED)

        def _now(self):
            """Right ascension and declination on the way, and whether it is under way."""
            ra = (self.target[0] - self.here[0] + 12.0) % 24.0 - 12.0
            dec = self.target[1] - self.here[1]
            whole = max(abs(ra) * 15.0, abs(dec))
            part = 1.0 if not whole else min(1.0, (time.monotonic() - self.since) * DEG_S / whole)
            return (self.here[0] + part * ra) % 24.0, self.here[1] + part * dec, part < 1.0

    here = sys.modules["ascom_telescope"] = sys.modules["__main__"]
    here.Telescope = Telescope
    threading.Timer(120.0, os._exit, (1,)).start()
    pythoncom.CoInitialize()
    served = factory.RegisterClassFactories([CLSID])
    pythoncom.EnableQuitMessage(win32api.GetCurrentThreadId())
    pythoncom.CoResumeClassObjects()
    pythoncom.PumpMessages()
    factory.RevokeClassFactories(served)
    os._exit(0)


if __name__ == "__main__":
    serve(sys.argv[1])
