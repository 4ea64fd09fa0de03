"""The dialects of the LX200 language, one row a make; what is not known of a make, its mounts lack.

Sources: the makers' protocol documents (Meade 2010, 10micron 2.13, Astro-Physics GTOCP4, Gemini L4 and L5, OnStepX,
NYX-101 1.0, ZWO 2.1, RainbowAstro 200629), INDI's drivers, and exchanges of real mounts.
"""

from collections.abc import Callable, Mapping
from dataclasses import field

from kochab.core.mount import SIDEREAL_DEG_S, Ability, MountState
from kochab.core.values import frozen
from kochab.gear.mounts.protocols import lx200 as protocol

Question = tuple[bytes, int, Callable[[bytes], MountState]]
"""A command, the size of its answer (0: up to ``#``), and what that says; what an earlier one says counts."""


def times(*rates: tuple[bytes, float]) -> dict[bytes, float]:
    """Commands of rates that are given as multiples of the sky's, degrees a second."""
    return {command: multiple * SIDEREAL_DEG_S for command, multiple in rates}


MEADE_RATES = times((b":RG#", 2), (b":RC#", 32)) | {b":RM#": 2.0, b":RS#": 6.0}
BARS: Question = (protocol.BARS, 0, protocol.parse_bars)
ON_STEP_FLAGS: Question = (protocol.STATUS, 0, protocol.parse_flags)
SIDE: Question = (b":pS#", 0, protocol.parse_side)


@frozen
class Dialect:
    """What a make does in its own way.

    ``names`` are parts of the product's name, lower case and without blanks and hyphens, which ``who`` asks for;
    ``boot_s`` is how long a board may be silent that the opening of its port resets. ``decimals`` are those of a
    target's seconds of time, since the version ``fine_since``; ``places`` ask for RA and Dec. ``echoes``: an answer
    begins with its question. ``tells_site`` and ``takes_site``: and its clock, in a Meade's words. ``pulse`` is given
    a direction and milliseconds, up to ``longest_pulse_ms`` (0: it has none). Where ``rates`` are set in the mount,
    these are only near. The first of ``questions`` is always answered, ``answered`` commands by 1 or 0. ``last_start``
    asks for a sign that it has started again, and how that reads.
    """

    title: str
    names: tuple[str, ...] = ()
    who: bytes = protocol.PRODUCT
    bauds: tuple[int, ...] = (9600,)
    tcp_port: int | None = None
    boot_s: int = 4
    precise: bytes = protocol.TOGGLE_PRECISION
    places: tuple[bytes, bytes] = (protocol.GET_RA, protocol.GET_DEC)
    decimals: int = 0
    fine_since: tuple[int, ...] = ()
    spaces: tuple[bool, ...] = (False, True)
    reads_back: bool = False
    echoes: bool = False
    tells_site: bool = True
    takes_site: bool = True
    pulse: bytes = b":Mg%c%04d#"
    longest_pulse_ms: int = 9999
    pulse_since: tuple[int, ...] = ()
    rates: Mapping[bytes, float] = field(default_factory=lambda: MEADE_RATES)
    rates_known: bool = True
    halts_axes: bool = True
    questions: tuple[Question, ...] = (BARS,)
    sync: bytes = protocol.SYNC
    slew_answered: bool = True
    refusals: Mapping[int, str] = field(default_factory=lambda: protocol.REFUSALS)
    commands: Mapping[Ability, bytes] = field(default_factory=dict)
    answered: frozenset[Ability] = frozenset()
    last_start: tuple[bytes, Callable[[bytes], str]] | None = None


CLASSIC = Dialect(
    "Meade LX200 classic",
    longest_pulse_ms=0,
    reads_back=True,
    questions=(BARS, (protocol.ALIGNMENT, 1, protocol.parse_aligned)),
)
CLONE = Dialect("LX200 compatible mount", reads_back=True)
AUTOSTAR = Dialect(
    "Meade Autostar",
    ("autostar", "audiostar", "lx2001", "lx200gps", "etx", "rcx"),
    questions=(BARS, (b":GW#", 0, protocol.parse_scope_status)),
    commands=protocol.AUTOSTAR_COMMANDS,
)
ON_STEP_RATES = times((b":RG#", 1), (b":RC#", 8), (b":RM#", 20), (b":R7#", 48))
ON_STEP_ANSWERS = frozenset(protocol.ON_STEP_COMMANDS) - {Ability.HOME}
ON_STEP = Dialect(
    "OnStep and OnStepX",
    ("onstep",),
    bauds=(9600, 115200),
    tcp_port=9999,
    boot_s=10,  # an ESP32 was silent for 8 s
    places=(b":GRH#", b":GDH#"),
    decimals=4,
    fine_since=(10,),
    rates=ON_STEP_RATES,
    questions=(ON_STEP_FLAGS,),
    commands=protocol.ON_STEP_COMMANDS,
    answered=ON_STEP_ANSWERS,
    last_start=(b":GX89#", protocol.parse_date_missing),
)

DIALECTS = {
    "onstep": ON_STEP,
    "10micron": Dialect(
        "10micron GM and AZ",
        ("10micron",),
        tcp_port=3492,
        precise=b":U1#:U2#",  # the second since version 2.10
        decimals=2,
        rates=times((b":RG2#", 1), (b":RC0#", 16), (b":RC1#", 64), (b":RC2#", 600)),
        questions=(BARS, (b":Gstat#", 0, protocol.parse_10micron), SIDE),
        commands=protocol.TEN_MICRON_COMMANDS,
    ),
    "am5": Dialect(
        "ZWO AM3, AM5 and AM7",
        ("am3", "am5", "am7"),
        tcp_port=4030,
        longest_pulse_ms=3000,
        rates=times((b":R2#", 1), (b":R5#", 8), (b":R6#", 20), (b":R7#", 60), (b":R8#", 720)),
        questions=((protocol.STATUS, 0, protocol.parse_zwo_status), (b":Gm#", 0, protocol.parse_side)),
        refusals=protocol.ZWO_REFUSALS,
        commands=protocol.ZWO_COMMANDS,
        answered=frozenset({Ability.TRACKING, Ability.SIDEREAL, Ability.LUNAR, Ability.SOLAR}),
        last_start=(b":GRR#", protocol.parse_text),
    ),
    "nyx": Dialect(
        "Pegasus NYX-101 and NYX-88",
        ("nyx",),
        bauds=(115200,),
        tcp_port=9999,
        places=(b":GRH#", b":GDH#"),
        rates=times((b":R2#", 1), (b":R4#", 8), (b":R5#", 20), (b":R6#", 64)),
        questions=(ON_STEP_FLAGS,),
        commands=protocol.ON_STEP_COMMANDS,
        answered=ON_STEP_ANSWERS,
    ),
    "teenastro": Dialect(
        "TeenAstro",
        ("teenastro",),
        bauds=(9600, 57600),
        tcp_port=9999,
        rates_known=False,  # they are set in the mount
        questions=(BARS, (b":GXI#", 0, protocol.parse_teenastro)),
        refusals=protocol.TEENASTRO_REFUSALS,
        commands={a: c for a, c in protocol.ON_STEP_COMMANDS.items() if a is not Ability.KING},
        answered=frozenset(protocol.ON_STEP_COMMANDS),
    ),
    "astrophysics": Dialect(
        "Astro-Physics GTO",
        ("vcp",),
        who=b":V#",
        precise=b":U#",  # here it doesn't toggle
        decimals=1,
        spaces=(True,),
        pulse=b":M%c%03d#",
        longest_pulse_ms=999,
        rates=times((b":RC0#", 12), (b":RC1#", 64)),  # the faster ones differ by make and version
        questions=((b":GOS#", 0, protocol.parse_gto), SIDE),
        takes_site=False,  # other commands, with other answers
        sync=b":CMR#",  # which keeps the side of the pier
        commands=protocol.GTO_COMMANDS,
    ),
    "gemini": Dialect(
        "Losmandy Gemini",
        ("losmandy", "gemini"),
        pulse_since=(5,),  # level 4 counts them modulo 256 steps
        rates_known=False,  # they are set in the mount
        questions=((b":Gv#", 1, protocol.parse_gemini), (b":h?#", 1, protocol.parse_gemini_parked)),
        commands=protocol.GEMINI_COMMANDS,
    ),
    "rainbow": Dialect(
        "RainbowAstro RST",
        (":av",),
        who=b":AV#",
        bauds=(115200,),
        tcp_port=7100,
        decimals=1,
        echoes=True,
        tells_site=False,  # its date since version 200625 only
        takes_site=False,
        longest_pulse_ms=0,
        rates_known=False,  # they are set in the mount
        halts_axes=False,  # before version 200625
        questions=((b":CL#", 0, protocol.parse_rainbow), (b":AT#", 0, protocol.parse_rainbow_tracking)),
        sync=b":Ck%07.3f%+07.3f#",
        slew_answered=False,
        commands=protocol.RAINBOW_COMMANDS,
    ),
}
"""Driver -> its dialect."""


def named(product: str) -> str:
    """The driver whose mounts call themselves so, empty when it is none of them."""
    plain = product.lower().replace(" ", "").replace("-", "")
    return next((name for name, row in DIALECTS.items() if any(part in plain for part in row.names)), "")
