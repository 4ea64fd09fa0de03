"""The serial ports of this computer, with what their USB side tells of them."""

from dataclasses import dataclass

ADAPTERS = {
    0x0403: "FTDI adapter (EQDIR cables, iOptron)",
    0x067B: "Prolific adapter (Celestron and SynScan hand controls)",
    0x1A86: "CH340 adapter (OnStep boards, newer Sky-Watcher mounts)",
    0x10C4: "Silicon Labs adapter (OnStep on an ESP32, iOptron)",
    0x2341: "Arduino",
    0x16C0: "Teensy (OnStep)",
    0x0483: "STMicroelectronics (mounts with their own USB)",
    0x04D8: "Microchip (mounts with their own USB)",
}
"""USB vendor -> the adapter, and where it is often met; many makes share one."""

MAKERS = ("celestron", "sky-watcher", "skywatcher", "ioptron", "onstep", "meade", "10micron")


@dataclass(frozen=True, slots=True)
class PortInfo:
    """One port; ``hint`` is what it might be, empty when nothing is known."""

    port: str
    description: str
    usb: str = ""
    hint: str = ""


def list_ports() -> list[PortInfo]:
    """Ports that have a device behind them, those on USB first."""
    from serial.tools import list_ports as tools

    found = [
        port_info(p.device, p.description, p.manufacturer, p.product, p.vid, p.pid)
        for p in tools.comports()
        if p.vid is not None or p.hwid not in ("", "n/a")
    ]
    return sorted(found, key=lambda p: (not p.usb, p.port))


def port_info(
    device: str,
    description: str | None,
    manufacturer: str | None = None,
    product: str | None = None,
    vendor: int | None = None,
    number: int | None = None,
) -> PortInfo:
    """Words for one port from what the system tells of it."""
    told = " ".join(dict.fromkeys(word for word in (manufacturer, product) if word))
    text = told or (description if description not in (None, "n/a") else "") or "serial port"
    usb = "" if vendor is None else f"{vendor:04x}:{number or 0:04x}"
    maker = next((m for m in MAKERS if m in f"{text} {description}".lower()), None)
    hint = f"a mount by {maker}" if maker else ADAPTERS.get(vendor or 0, "")
    return PortInfo(device, text, usb, hint)
