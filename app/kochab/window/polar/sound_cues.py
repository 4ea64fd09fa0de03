"""Sound cues while adjusting the bolts: tones and spoken instructions.

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
from kochab.workflows.session.alignment_state import AlignmentState

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


CLEAR_SHARE, CLEAR_ARCSEC = 0.1, 5.0
"""A change of the total error by this share of it, and by so many arcseconds, is played."""


class SoundCues:
    """Turns changes of the alignment into cues."""

    def __init__(self, cues: Cues) -> None:
        self._cues = cues
        self._played_arcsec: float | None = None

    def play_change(self, before: AlignmentState, now: AlignmentState) -> None:
        """Play the most important cue of a change, and speak a new instruction."""
        cue = self.cue_of(before, now)
        if cue is not None:
            self._cues.play(cue)
        # Their amounts change with every frame: what is asked is said once.
        asked = now.instruction is not before.instruction or now.turn_instruction is not before.turn_instruction
        new = asked or (now.instruction is None and now.words != before.words)
        if new and (now.hand_needed or now.stop or now.stage == "done"):
            self._cues.say(speech_text(now.words))

    def cue_of(self, before: AlignmentState, now: AlignmentState) -> Cue | None:
        """The cue of a change, None for silence."""
        if before.solved and not now.solved:
            return Cue.LOST
        if (now.stop and not before.stop) or (now.stage == "done" != before.stage):
            return Cue.STOP
        new = now.turn_instruction is not before.turn_instruction or now.instruction is not before.instruction
        if now.hand_needed and new:
            self._played_arcsec = None if now.error is None else now.error.total_arcsec
            return Cue.TURN
        return self._nearer(now)

    def _nearer(self, now: AlignmentState) -> Cue | None:
        if not now.live or now.error is None:
            return None
        total, then = now.error.total_arcsec, self._played_arcsec
        if then is None:
            self._played_arcsec = total
            return None
        if abs(total - then) < max(CLEAR_SHARE * then, CLEAR_ARCSEC):
            return None
        self._played_arcsec = total
        return Cue.NEARER if total < then else Cue.FURTHER


def speech_text(words: str) -> str:
    """Words for a voice: units in full."""
    for sign, name in (("″", tr(" arc seconds")), ("′", tr(" arc minutes")), ("±", tr("plus or minus"))):
        words = words.replace(sign, name)
    return words
