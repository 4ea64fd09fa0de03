"""The page of mounts, from the drivers' own tables: ``python -m tests.gear.mounts.mounts_page`` writes it."""

from pathlib import Path

from kochab.core.mount import Ability
from kochab.gear.mounts import DRIVERS, SERVERS
from tests.gear.mounts.bench import simulated
from tests.gear.mounts.sequences import MOUNTS
from tests.gear.mounts.test_real_transcripts import ELSEWHERE, PLAYED
from tests.patterns import REPOSITORY
from tests.simulate.test_indi import ALSO, FAMILIES, GOTO_ONLY, SYNC_ONLY

PAGE = Path(REPOSITORY) / "app" / "MOUNTS.md"
WORDS = {
    "sync": (Ability.SYNC,),
    "goto": (Ability.GOTO,),
    "guide pulse": (Ability.PULSE,),
    "move": (Ability.MOVE,),
    "tracking on and off": (Ability.TRACKING,),
    "lunar and solar rate": (Ability.LUNAR, Ability.SOLAR),
    "park": (Ability.PARK,),
    "unpark": (Ability.UNPARK,),
    "home": (Ability.HOME,),
    "tells site and time": (Ability.SITE, Ability.TIME),
    "takes site and time": (Ability.SET_SITE, Ability.SET_CLOCK),
}
"""What the table says, and the abilities it stands for."""
EXCHANGES = {
    "lx200": (1, 15),
    "onstep": (20, 29),
    "am5": (30, 36),
    "10micron": (40, 44),
    "ioptron": (50, 57),
    "nexstar": (60, 64),
    "synscan": (70, 72),
    "skywatcher": (80, 98),
    "celestronaux": (100, 112),
    "astrophysics": (120, 120),
    "gemini": (125, 126),
}
"""Driver -> first and last number of its family in the collection of real exchanges; L2A and L2B are OnStep's too."""
HEAD = """# Which mounts, and how each was tried

**No real telescope has met Kochab yet.** What stands here is what was tried instead. `--driver` names the first column; without it
Kochab asks the port who is there. `python -m tests.gear.mounts.mounts_page` writes this page from the drivers' own tables, and a test
fails when they differ.

| driver | mounts | line | what it can do | how it was tried |
| --- | --- | --- | --- | --- |
"""
TAIL = """
What is not in a row the mount, or its language, cannot do, or no source tells how; Kochab then says so and sends nothing. Every driver
moves behind the same guard: horizon, Sun, meridian, length, read-back, Stop.

- **Real exchanges:** what real mounts sent and answered to other programs, in logs and owners' reports, played back to the driver byte
  for byte (`tests/gear/mounts/test_real_transcripts.py`, which names each by its number, and those that no driver could meet).
- **INDI's own driver:** written by others, it syncs our simulated mount, slews it and reads it back (`tests/simulate/test_indi.py`).
- **Simulator:** ours, written from the maker's protocol document and from what INDI's drivers expect, never from our driver
  (`kochab/simulate/responders`, `tests/simulate/dialects.py`). Where a row names nothing else, only our reading of a document stands behind it.
- **Random evenings:** connect, power cycle, another program, sync, goto, flip, nudge, tracking, park, home, Stop, a pulled cable, silence
  and `kill -9` in random order, while the simulator's mechanical axes are watched: `python -m tests.gear.mounts.sequences 2000`, and
  `python -m tests.gear.mounts.indi_sequences 60` at INDI's telescope simulator and at EQMod's simulated board.
  They cannot know a mount that was switched off and on where it stands *before* Kochab connects: it says that it is at home, and nothing
  in its language tells otherwise. Sync on a solved frame first.
- **Killed in a nudge** (`kill -9`, `tests/gear/mounts/test_killed.py`): at all drivers a nudge of 5° ended by itself within 2°, and a move
  at a rate that a person chose ran on at all but `skywatcher`, `celestronaux` and `alpaca`, as Kochab says before it moves. A nudge by
  goto ends within 2°, not always within a second: a mount of 1°/s takes two.
- **Celestron's Wi-Fi** also met the simulator of INDI's celestronaux driver (`nse_simulator.py`, no part of this repository; a
  German mount's model and 16-bit rates had to be taught to it): slews, tracking, nudges and Stop on the side of the pier that it can
  show. It turns its altitude axis the long way round below zero, and Kochab stopped that.
- **Through INDI alone**, tried against Debian's driver on a simulated mount that is written from protocols and from INDI's and INDIGO's
  sources (`tests/boards`, `tests/boards/test_through_indi.py`): connect, position, goto, sync, Stop, park, nudge, power cuts, a lost line.
  - **Avalon StarGO** (`indi_lx200stargo`): all of these. A goto sent just when its power fails is passed on by INDI's driver four seconds
    later, to a mount that just woke up: Kochab stops it there.
  - **Vixen StarBook** (`indi_starbook_telescope`, by network): all but guide pulses and tracking off. INDI tells and takes whole minutes of
    declination and tenths of a minute of right ascension, so a sync is good to about 3'. Set time and site on its screen: aligned, it takes neither,
    and INDI 0.8 cannot set its site at all. At a time-out INDI's driver ends: give it the address again, and reconnect.
  - **Bresser EXOS-2 GoTo** (`indi_bresserexos2`): all of these, but it takes a sync only after the keys of its hand control were used, and Stop
    ends tracking. INDI's driver repeats the last place of a mount that fell silent, so before each goto and park Kochab sends Stop and
    waits, about two seconds, until the place drifts: one that says nothing, or that it is elsewhere, is sent nowhere.
    Its clock takes no 29th, 30th or 31st but in leap years: set its date on its hand control.
    On an Intel or AMD computer Debian's version 0.901 hears nothing of the mount, and Kochab says that it reports no position; use a
    Raspberry Pi, or a newer driver.
- **Not tried at all:** alt-azimuth mounts without a hand control, forks on a wedge in the south by Celestron's Wi-Fi. Kochab refuses them
  with what to do instead.
"""


def line(name):
    """Where the mount is reached."""
    if name in SERVERS:
        return {"indi": "INDI server, port 7624", "alpaca": "Alpaca server, found by discovery"}[name]
    driver = DRIVERS.load(name)
    told = [f"serial, {' or '.join(map(str, driver.bauds))} baud"]
    if name == "skywatcher":
        told.append("UDP 11880 (Wi-Fi)")
    elif driver.tcp_port:
        told.append(f"TCP, usually {driver.tcp_port}")
    return "; ".join(told)


def can(name):
    """What its driver finds at a simulated mount."""
    if name in SERVERS:
        return "what the server's driver offers"
    with simulated(name) as bench:
        mount = bench.open()
        lacks, state = set(mount.lacks), mount.state()
        mount.close()
    told = [word for word, abilities in WORDS.items() if not lacks & set(abilities)]
    told += ["tells its pier side"] if state.pier_side is not None else []
    return ", ".join(told)


def tried(name):
    """By whose hands, the strongest first."""
    told = []
    first, last = EXCHANGES.get(name, (1, 0))
    numbers = {f"L{n:02d}" for n in range(first, last + 1)} | ({"L2A", "L2B"} if name == "onstep" else set())
    if count := len(numbers & (PLAYED | ELSEWHERE.keys())):
        told.append(f"{count} real exchange{'s' if count > 1 else ''}")
    if name == "indi":
        told.append(
            "INDI's telescope simulator, its EQMod with its simulated board, its LX200 and iOptron drivers; "
            "Debian's drivers of three families more on simulated mounts (below)"
        )
    if name == "alpaca":
        told.append("a server of ours, written from ASCOM's reference")
    for program, far_end in (*((program, known) for program, (_, known) in FAMILIES.items()), *ALSO):
        if far_end == name:
            only = " (goto only)" if program in GOTO_ONLY else " (sync only)" if program in SYNC_ONLY else ""
            told.append(f"`{program}` drives its simulator{only}")
    if name in MOUNTS:
        told.append("random evenings at its simulator")
    elif name == "indi":
        told.append("random evenings")
    return "; ".join(told)


def page():
    """All of it."""
    rows = [
        f"| `{name}` | {DRIVERS.load(name).title} | {line(name)} | {can(name)} | {tried(name)} |" for name in DRIVERS
    ]
    return HEAD + "\n".join(rows) + "\n" + TAIL


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
