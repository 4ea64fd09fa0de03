"""Celestron's NexStar hand control language, which SynScan shares.

Source: NexStar Communication Protocol 1.2 (2006); SynScan serial protocol 3.3. Every answer ends
in ``#``, but a data byte may be ``#`` as well: answers are read by their length. Below is the bus behind the hand
control, which Celestron's Wi-Fi and the mounts' own USB speak.
"""

from datetime import datetime, timedelta
from time import monotonic

from kochab.core.frame import Site
from kochab.core.mount import PierSide
from kochab.gear.mounts.coordinates import utc_of
from kochab.gear.mounts.protocols import code_table, match, require
from kochab.gear.mounts.serial_line import ProtocolError, Reader, SerialLink

TURN = 1 << 32
GET_PRECISE, GET_COARSE = b"e", b"E"
ALTAZ_PRECISE, ALTAZ_COARSE = b"z", b"Z"
VERSION, VARIANT, MODEL, ALIGNED, SLEWING = b"V", b"v", b"m", b"J", b"L"
TRACKING, CANCEL, PIER, SITE, TIME = b"t", b"M", b"p", b"w", b"h"
AZM, ALT = 16, 17  # the motor boards: RA or azimuth, Dec or altitude
POSITIVE, NEGATIVE, GUIDE = 36, 37, 38  # move at a fixed rate, 0 to 9; guide pulse

MODELS = code_table(
    "1 NexStar GPS, 3 NexStar i-Series, 4 NexStar i-Series SE, 5 CGE, 6 Advanced GT, 7 SLT, 9 CPC, 10 GT, "
    "11 NexStar 4/5 SE, 12 NexStar 6/8 SE, 13 CGE Pro, 14 CGEM DX, 15 LCM, 16 Sky Prodigy, 17 CPC Deluxe, "
    "18 GT 16, 19 StarSeeker, 20 AVX, 21 Cosmos, 22 Evolution, 23 CGX, 24 CGXL, 25 Astro Fi, 26 SkyWatcher"
)


def angle_hex(angle_deg: float) -> str:
    """Eight digits of an angle, two's complement in 2^32 parts of a turn."""
    return f"{round(angle_deg / 360.0 * TURN) % TURN:08X}"


def goto(ra_deg: float, dec_deg: float, precise: bool = True) -> bytes:
    """``rXXXXXXXX,XXXXXXXX``, or ``RXXXX,XXXX`` for versions before 1.6."""
    letter, digits = ("r", 8) if precise else ("R", 4)
    # Four digits are the upper half of the eight: 16 bits of a turn.
    return f"{letter}{angle_hex(ra_deg)[:digits]},{angle_hex(dec_deg)[:digits]}".encode()


def sync(ra_deg: float, dec_deg: float) -> bytes:
    """``sXXXXXXXX,XXXXXXXX``."""
    return f"s{angle_hex(ra_deg)},{angle_hex(dec_deg)}".encode()


def parse_position(reply: bytes) -> tuple[float, float]:
    """RA and Dec (azimuth and altitude), degrees, of ``34AB0500,12CE0500#`` or ``34AB,12CE#``."""
    found = match(rb"([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8}),([0-9A-Fa-f]{4}|[0-9A-Fa-f]{8})#", reply, "position")
    require(len(found[1]) == len(found[2]), reply, "position")
    ra, dec = (int(part, 16) / 16 ** len(found[1]) * 360.0 for part in found.groups())
    dec = dec - 360.0 if dec >= 180.0 else dec
    if abs(dec) > 90.0:  # the far side of a declination axis
        dec = (180.0 - abs(dec)) * (1.0 if dec > 0 else -1.0)
        ra = (ra + 180.0) % 360.0
    return ra, dec


def parse_done(reply: bytes) -> None:
    """The bare ``#``."""
    require(reply == b"#", reply, "bare #")


def parse_echo(reply: bytes, sent: bytes) -> None:
    """The answer to ``K`` and one byte."""
    require(reply == sent + b"#", reply, f"echo of {sent!r}")


def parse_byte(reply: bytes) -> int:
    """One binary byte and ``#``."""
    require(len(reply) == 2 and reply[1:] == b"#", reply, "byte and #")
    return reply[0]


def parse_flag(reply: bytes) -> bool:
    """The binary 0 or 1 of ``J``."""
    return match(rb"([\0\1])#", reply, "0 or 1")[1] == b"\1"


def parse_digit(reply: bytes) -> bool:
    """The ASCII ``0`` or ``1`` of ``L``."""
    return match(rb"([01])#", reply, "0 or 1")[1] == b"1"


def read_version(timeout_s: float) -> Reader:
    """Read three bytes, or seven when they are SynScan's digits."""

    def read(link: SerialLink) -> bytes:
        reply = link.read_exact(3, timeout_s)
        return reply if reply[2:] == b"#" else reply + link.read_exact(4, timeout_s)

    return read


def parse_version(reply: bytes) -> tuple[int, ...]:
    """Two bytes and ``#``, or SynScan's six digits and ``#``: (4, 37, 7)."""
    if len(reply) == 3 and reply[2:] == b"#":
        return reply[0], reply[1]
    return tuple(bytes.fromhex(match(rb"([0-9A-Fa-f]{6})#", reply, "version")[1].decode()))


def parse_pier(reply: bytes) -> PierSide:
    """``E#`` or ``W#``: the side it looks at, which is not the one it is on (INDI's celestrongps.cpp)."""
    side = match(rb"([EW])#", reply, "side of the pier")[1]
    return PierSide.WEST if side == b"E" else PierSide.EAST


def pass_through(board: int, command: int, *data: int, answer: int = 0) -> bytes:
    """``50 len board command d1 d2 d3 n``: eight bytes through the hand control to a motor board.

    Parameters
    ----------
    board : int
        Its address.
    command : int
        Its command.
    *data : int
        At most three bytes.
    answer : int
        Length of the answer.
    """
    # Always three data bytes; the length counts the command and those in use.
    return bytes([0x50, 1 + len(data), board, command, *(*data, 0, 0, 0)[:3], answer])


def move_fixed(board: int, positive: bool, rate: int) -> bytes:
    """Move at a rate from 0, which stops, to 9."""
    return pass_through(board, POSITIVE if positive else NEGATIVE, rate)


def parse_passed(reply: bytes, answer: int = 0) -> bytes:
    """The ``answer`` bytes of a pass-through; a failure has one 0 more before ``#``."""
    if len(reply) == answer + 2 and reply[-2:] == b"\x00#":
        raise ProtocolError("The hand control could not reach the motor board.")
    require(len(reply) == answer + 1 and reply[-1:] == b"#", reply, "answer of a motor board")
    return reply[:-1]


def guide(board: int, percent: int, hundredths: int) -> bytes:
    """A pulse of so many hundredths of a second (1 to 255) at a signed percentage of sidereal."""
    return pass_through(board, GUIDE, percent % 256, hundredths)  # the percentage is a signed byte


def track(mode: int) -> bytes:
    """0 off, 1 altitude and azimuth, 2 equatorial north, 3 equatorial south."""
    return b"T" + bytes([mode])


def parse_site(reply: bytes) -> Site:
    """The nine bytes of ``w``: degrees, minutes, seconds, 1 for south or west, of both angles."""
    require(len(reply) == 9 and reply[8:] == b"#" and max(reply[3], reply[7]) <= 1, reply, "site")
    latitude, longitude = (
        (d + m / 60.0 + s / 3600.0) * (-1.0 if minus else 1.0) for d, m, s, minus in (reply[:4], reply[4:8])
    )
    sixtieths = reply[1:3] + reply[5:7]
    require(abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and max(sixtieths) <= 59, reply, "site")
    return Site(latitude, longitude)


def set_site(site: Site) -> bytes:
    """``W`` and the eight bytes of :func:`parse_site`."""
    data = bytearray(b"W")
    for angle in (site.latitude_deg, site.longitude_deg):
        seconds = round(abs(angle) * 3600.0)
        data += bytes([seconds // 3600, seconds // 60 % 60, seconds % 60, angle < 0.0])
    return bytes(data)


def set_clock(now: datetime) -> bytes:
    """``H`` and the eight bytes of :func:`parse_time`: a local time in a zone of whole hours."""
    zone = round((now.utcoffset() or timedelta()) / timedelta(hours=1)) % 256
    return b"H" + bytes([now.hour, now.minute, now.second, now.month, now.day, now.year % 100, zone, 0])


def parse_time(reply: bytes) -> tuple[datetime, float]:
    """Universal time and the hours of the zone from the nine bytes of ``h``."""
    require(len(reply) == 9 and reply[8:] == b"#" and reply[7] <= 1, reply, "time")
    hour, minute, second, month, day, year, zone, summer = reply[:8]
    offset = float((zone - 256 if zone > 127 else zone) + summer)  # the zone is a signed byte
    require(abs(offset) <= 15.0, reply, "time")
    try:
        return utc_of(2000 + year, month, day, hour, minute, second, offset), offset
    except ValueError:
        raise ProtocolError("{reply!r} is no time.", reply=reply) from None


# -- The AUX bus: ``3b len from to command data checksum`` ----------------------------------------
# Source: A. Paquette, NexStar AUX Command Set (2003), INDI's celestronaux, captures of real mounts. Angles are 24 bits
# of a turn. Wi-Fi sends each command back before its answer, and every device on the bus may speak in between.

HEAD, APP = 0x3B, 0x20  # APP: our address on the bus, that of the maker's app
POSITION, AUX_MODEL, GOTO_FAST, GUIDE_POSITIVE, GUIDE_NEGATIVE = 0x01, 0x05, 0x02, 0x06, 0x07
SLEW_DONE, GOTO_SLOW, AUX_VERSION, AUX_REFUSED = 0x13, 0x17, 0xFE, 0xF0
LONGEST_CHATTER = 256
AUX_TURN = 1 << 24


def aux(board: int, command: int, data: bytes = b"", sender: int = APP) -> bytes:
    """A frame to a motor board, or another device.

    Parameters
    ----------
    board : int
        Address of the board that it is for.
    command : int
        Its command.
    data : bytes
        The command's own bytes.
    sender : int
        Address that the answer goes to.
    """
    # All bytes after the head, checksum included, add up to 0 modulo 256.
    body = bytes([3 + len(data), sender, board, command]) + data
    return bytes([HEAD]) + body + bytes([-sum(body) % 256])


def aux_answer(asked: bytes, came: bytes) -> bytes | None:
    """The frame in ``came`` that answers ``asked``, or refuses it; None while it is not there."""
    for k, byte in enumerate(came):
        # The length leaves out head, itself and checksum. A 3b inside a frame fails the checksum.
        end = k + came[k + 1] + 3 if byte == HEAD and k + 1 < len(came) else 0
        frame = came[k:end]
        # Sender and receiver are swapped: neither our own echo nor another device's answer.
        if not 6 <= len(frame) == end - k or sum(frame[1:]) % 256 or frame[2:4] != asked[3:1:-1]:
            continue
        if frame[4] == asked[4] or (frame[4] == AUX_REFUSED and frame[5] == asked[4]):
            return frame
    return None


def aux_reader(asked: bytes, timeout_s: float) -> Reader:
    """Read until the answer has come; not for longer, however long a line trickles."""

    def read(link: SerialLink) -> bytes:
        came, end_s = bytearray(), monotonic() + timeout_s
        while len(came) < LONGEST_CHATTER and monotonic() < end_s:
            came += link.read_exact(1, timeout_s)
            if answer := aux_answer(asked, bytes(came)):
                return answer
        raise ProtocolError("The bus is busy, and the motor board does not answer.")

    return read


def parse_aux(reply: bytes, *sizes: int) -> bytes:
    """The data of a frame, of one of these sizes, else none; `ProtocolError` for a refusal."""
    sound = len(reply) >= 6 and reply[0] == HEAD and reply[1] == len(reply) - 3 and not sum(reply[1:]) % 256
    require(sound, reply, "frame of the AUX bus")
    require(reply[4] != AUX_REFUSED and len(reply) - 6 in (sizes or (0,)), reply, "answer of a motor board")
    return reply[5:-1]


def parse_aux_angle(reply: bytes) -> float:
    """Degrees in [-180, 180), from 24 bits of a turn."""
    part = int.from_bytes(parse_aux(reply, 3), "big", signed=True)
    return part / AUX_TURN * 360.0


def aux_angle(angle_deg: float) -> bytes:
    """The inverse of :func:`parse_aux_angle`, for any angle."""
    return (round(angle_deg / 360.0 * AUX_TURN) % AUX_TURN).to_bytes(3, "big")


def parse_aux_done(reply: bytes) -> bool:
    """Whether a goto is over: ``ff``, and ``00`` before."""
    return match(rb"[\x00\xff]", parse_aux(reply, 1), "0 or 255")[0] == b"\xff"
