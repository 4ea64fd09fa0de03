"""Tones and spoken words, by the system's own player and voice.

Kochab does not install Qt's sound module: the tones are made here and played by the system's own
player, words are spoken by its own voice, and without a player the system's bell rings.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import wave
from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import Enum
from pathlib import Path

import numpy as np

from kochab.text.translation import tr

RATE_HZ = 22050
LOUDNESS = 0.4
# Of PipeWire, PulseAudio, ALSA and macOS.
PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
VOICES = (("spd-say", "--"), ("espeak-ng", "--"), ("say", "--"))  # "--": what follows is text


class Cue(Enum):
    """Sounds as tones of (Hz, seconds)."""

    TURN = ((660.0, 0.12), (880.0, 0.12))
    NEARER = ((990.0, 0.08),)
    FURTHER = ((330.0, 0.18),)
    STOP = ((880.0, 0.15), (1100.0, 0.15), (1320.0, 0.4))
    LOST = ((220.0, 0.4),)


class Cues:
    """Plays cues and speaks while ``on``; ``bell`` is rung where nothing can play."""

    def __init__(self, bell: Callable[[], None], find: Callable[[str], str | None] = shutil.which) -> None:
        self.on = False
        self._bell = bell
        self._player = first_of(PLAYERS, find)
        self._voice = first_of(VOICES, find)
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._running: list[subprocess.Popen[bytes]] = []

    @property
    def description(self) -> str:
        """What this computer can play."""
        tones = tr("the system's bell only")
        if sys.platform == "win32":
            tones = tr("tones")
        elif self._player:
            tones = tr("tones by {name}", name=Path(self._player[0]).name)
        voice = tr("words by {name}", name=Path(self._voice[0]).name) if self._voice else tr("no voice installed")
        return f"{tones}; {voice}"

    def play(self, cue: Cue) -> None:
        """Play a cue, if sounds are on; returns at once."""
        if not self.on:
            return
        if sys.platform == "win32":
            import winsound

            winsound.PlaySound(str(self._file(cue)), winsound.SND_FILENAME | winsound.SND_ASYNC)
        elif self._player:
            self._start([*self._player, str(self._file(cue))])
        else:
            self._bell()

    def say(self, words: str) -> None:
        """Speak, if sounds are on; returns at once."""
        if self.on and self._voice:
            self._start([*self._voice, words])

    def close(self) -> None:
        """Stop all sounds and remove the files."""
        for process in self._running:
            process.kill()  # one that has ended is left alone
            process.wait()
        self._running.clear()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def _start(self, command: Sequence[str]) -> None:
        self._running = [p for p in self._running if p.poll() is None]
        nothing = subprocess.DEVNULL
        with suppress(OSError):  # without its player the cue stays silent
            self._running.append(subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing))

    def _file(self, cue: Cue) -> Path:
        if self._folder is None:
            # Windows may still play from it when it is removed.
            self._folder = tempfile.TemporaryDirectory(prefix="kochab-", ignore_cleanup_errors=True)
        path = Path(self._folder.name) / f"{cue.name.lower()}.wav"
        if not path.exists():
            write_tones(path, cue.value)
        return path


def first_of(commands: Sequence[Sequence[str]], find: Callable[[str], str | None]) -> tuple[str, ...]:
    """The first installed command, with its absolute path; empty when none is."""
    for program, *rest in commands:
        found = find(program)
        # A relative path would be a program of the present folder.
        if found is not None and os.path.isabs(found):
            return (found, *rest)
    return ()


def write_tones(path: Path, tones: Sequence[tuple[float, float]]) -> None:
    """Write a 16-bit WAV file of sine tones, faded in and out against clicks."""
    samples = []
    for hertz, seconds in tones:
        k = np.arange(round(seconds * RATE_HZ))
        # Over 200 samples, 9 ms, at either end.
        fade = np.minimum(1.0, np.minimum(k, len(k) - k) / 200.0)
        samples.append(LOUDNESS * fade * np.sin(2.0 * np.pi * hertz * k / RATE_HZ))
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes((32767 * np.concatenate(samples)).astype("<i2").tobytes())
