"""Sounds for hands that are busy and eyes that are on the bolts: tones, and spoken words.

The part of Qt that plays sounds is not among what Kochab installs; the tones are made here and
given to the system's own player, and words to its own voice. Where there is none the system's bell
rings, and the screen says so.
"""

import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import wave
from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import Enum
from pathlib import Path

RATE_HZ = 22050
LOUDNESS = 0.4
PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
VOICES = (("spd-say", "--"), ("espeak-ng", "--"), ("say", "--"))


class Cue(Enum):
    """What there is to hear: tones as (Hz, seconds), one after the other."""

    TURN = ((660.0, 0.12), (880.0, 0.12))
    NEARER = ((990.0, 0.08),)
    FURTHER = ((330.0, 0.18),)
    STOP = ((880.0, 0.15), (1100.0, 0.15), (1320.0, 0.4))
    LOST = ((220.0, 0.4),)


class Cues:
    """Plays cues and says words while ``on``; ``bell`` is rung where nothing can play."""

    def __init__(
        self, bell: Callable[[], None], find: Callable[[str], str | None] = shutil.which
    ) -> None:
        self.on = False
        self.aloud = False
        self._bell, self._find = bell, find
        self._player = first_of(PLAYERS, find)
        self._voice = first_of(VOICES, find)
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._running: list[subprocess.Popen[bytes]] = []

    @property
    def told(self) -> str:
        """What will be heard, honestly."""
        tones = "the system's bell only"
        if sys.platform == "win32":
            tones = "tones"
        elif self._player:
            tones = f"tones by {Path(self._player[0]).name}"
        voice = f"words by {Path(self._voice[0]).name}" if self._voice else "no voice installed"
        return f"{tones}; {voice}"

    @property
    def can_speak(self) -> bool:
        """Whether the system has a voice."""
        return bool(self._voice)

    def play(self, cue: Cue) -> None:
        """Let a cue be heard, if sounds are on; never waits."""
        if not self.on:
            return
        if sys.platform == "win32":
            import winsound

            winsound.PlaySound(
                str(self._file(cue)), winsound.SND_FILENAME | winsound.SND_ASYNC
            )  # fmt: skip
        elif self._player:
            self._start([*self._player, str(self._file(cue))])
        else:
            self._bell()

    def say(self, words: str) -> None:
        """Speak, if that is on; never waits."""
        if self.aloud and self._voice:
            self._start([*self._voice, words])

    def close(self) -> None:
        """Fall silent and tidy up."""
        for process in self._running:
            if process.poll() is None:
                process.kill()
            process.wait()
        self._running.clear()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _start(self, command: Sequence[str]) -> None:
        self._running = [p for p in self._running if p.poll() is None]
        nothing = subprocess.DEVNULL
        with suppress(OSError):  # a player that cannot be started is silence, no fault
            self._running.append(
                subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing)
            )

    def _file(self, cue: Cue) -> Path:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(
                prefix="kochab-",
                ignore_cleanup_errors=True,  # Windows may still play from it
            )
        path = Path(self._folder.name) / f"{cue.name.lower()}.wav"
        if not path.exists():
            write_tones(path, cue.value)
        return path


def first_of(
    commands: Sequence[Sequence[str]], find: Callable[[str], str | None]
) -> tuple[str, ...]:
    """The first command that is installed, with its whole path; empty when none is."""
    for program, *rest in commands:
        found = find(program)
        if found is not None and os.path.isabs(found):
            return (found, *rest)
    return ()


def write_tones(path: Path, tones: Sequence[tuple[float, float]]) -> None:
    """A WAV file of sine tones, 16 bits, each swelling and fading against clicks."""
    samples: list[int] = []
    for hertz, seconds in tones:
        count = round(seconds * RATE_HZ)
        for k in range(count):
            swell = min(1.0, k / 200.0, (count - k) / 200.0)
            value = LOUDNESS * swell * math.sin(2.0 * math.pi * hertz * k / RATE_HZ)
            samples.append(round(32767 * value))
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(struct.pack(f"<{len(samples)}h", *samples))
