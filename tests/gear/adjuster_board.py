"""The firmware of a motorised polar-alignment platform (X = azimuth, Y = altitude), simulated from public sources:
[ino] michelebergo/oapa-firmware: oapa.ino 1.2.0 and 1.2.2, src/oapa_protocol.inc (1.2.3), README.md;
[accel] AccelStepper.cpp, its motion library; [plugin] isbeorn/nina.plugin.polaralignment: drivers and wire tests;
[grbl] gnea/grbl 1.1: serial.c, protocol.c, system.c, gcode.c, report.c, jogging.md, interface.md."""

import math
import os
import re
import select
import threading
import time

import pytest

pty, tty = (pytest.importorskip(name) for name in ("pty", "tty"))  # Windows has none


class _Motor:
    """Goes to its target with ramps of constant acceleration, whatever it was doing before ([accel])."""

    def __init__(self, acceleration):
        self.acceleration, self.rate, self.place, self.target, self.speed = acceleration, 1.0, 0.0, 0, 0.0

    def brake(self):
        self.target = round(self.place + self.speed * abs(self.speed) / (2 * self.acceleration))

    def advance(self, seconds, stalled):
        before, slices = round(self.place), 0 if stalled else math.ceil(seconds * 1000)
        self.speed *= not stalled
        for _ in range(slices):
            left, tick, steepest = self.target - self.place, seconds / slices, self.acceleration * seconds / slices
            if abs(left) < 0.5 and abs(self.speed) < 100:
                self.place, self.speed = float(self.target), 0.0
                break
            wanted = min(self.rate, math.sqrt(2 * self.acceleration * abs(left)), abs(left) / tick)
            self.speed += max(-steepest, min(steepest, math.copysign(wanted, left) - self.speed))
            self.place += self.speed * tick
        return round(self.place) - before


class AdjusterBoard:
    """`position`, `state`: as of the last advance(). `mute`: obeys, says nothing; `stalled`: letters of axes that
    stay in "Run" at a frozen place ([plugin] wire test); `homing`: "Home". 2000, 1000: [ino]; inf: no ramps."""

    def __init__(
        self,
        *,
        steps_a_second=2000.0,
        version="1.2.3",
        grbl=False,
        moved=lambda azimuth_steps, altitude_steps: None,
        now=time.monotonic,
        acceleration=1000.0,
    ):
        self.steps_a_second, self.version, self.grbl, self.moved, self.now = steps_a_second, version, grbl, moved, now
        self.mute, self.stalled, self.homing, self.received, self._seen = False, set(), False, [], now()
        self.acceleration, self._release = acceleration, tuple(int(part) for part in version.split("."))
        self.steps_per_mm, self._busy = (250.0, "Jog") if grbl else (1.0, "Run")  # [grbl] interface.md $100, report.c
        self.boot()

    def boot(self):
        """Power-up: the position is lost ([ino] setup). Returns the greeting ([ino] setup, [grbl] report.c)."""
        self._held, self._line, self.motors = False, b"", {letter: _Motor(self.acceleration) for letter in "XY"}
        self.advance()
        return (
            b"\r\nGrbl 1.1f ['$' for help]\r\n"
            if self.grbl
            else (
                "\n--- OAPA controller ready ---\r\nfirmware "
                f"{self.version} | protocol: github.com/michelebergo/oapa-firmware\r\n$H homes axes with an endstop, "
                "zeroes the others in place\r\nWaiting for commands...\r\n"
            ).encode()
        )

    def advance(self):
        """Brings both motors, which run at the same time ([ino] loop), up to the clock. For one thread only."""
        before, self._seen = self._seen, self.now()
        made = [motor.advance(self._seen - before, letter in self.stalled) for letter, motor in self.motors.items()]
        self.position = {letter: round(motor.place) for letter, motor in self.motors.items()}
        moving = any(motor.speed or abs(motor.target - motor.place) >= 0.5 for motor in self.motors.values())
        self.state = "Home" if self.homing else self._busy if moving else "Hold:0" if self._held else "Idle"
        if any(made):
            self.moved(*made)

    def answer(self, line):
        return self.hear(line + b"\n")

    def hear(self, data):
        """Either of \\r and \\n ends a line ([ino] loop, [grbl] protocol.c). `received` has no empty lines."""
        said = b""
        for char in data:
            self.advance()
            if self.grbl and char in b"?!~\x85":
                self.received.append(bytes([char]))
                said += self._grbl_at_once(char)
            elif self._held or char not in b"\r\n":
                self._line += bytes([char])
            else:
                line, self._line = self._line, b""
                self.received += [line] if line else []
                said += (self._grbl_line if self.grbl else self._oapa_line)(line.decode("latin-1"))
        self.advance()
        return b"" if self.mute else said

    def _oapa_line(self, line):
        """[ino] dispatchCommand: ok for what it does not know, error for a lone letter and, before 1.2.1, for `!`."""
        text, direct = line.strip(), re.match(r"[XYxy](?:\d+|-\d*)", line.strip())
        if text.startswith("?"):
            (x, y), version = self.position.values(), f"V:{self.version}|" if self._release >= (1, 1, 0) else ""
            return f"<{self.state}|MPos:{x:.2f},{y:.2f},0.00|{version}>\r\nok\r\n".encode()
        if text.startswith("!") and self._release >= (1, 2, 1):
            for motor in self.motors.values():
                motor.brake()
        elif text.startswith("$H"):  # handleHoming: no endstop by default
            self.motors = {letter: _Motor(self.acceleration) for letter in "XY"}
            zeroed = [f"Homing: {axis} has no endstop, zeroed in place\r\n" for axis in ("azimuth", "altitude")]
            return "".join([*zeroed, "Homing complete\r\nok\r\n"]).encode()
        elif direct or (text.startswith("$J=") and re.search("G91|G53", text)):
            self._jog("G91" + direct[0].upper() if direct else text, r"([FXY])(-?(?:\d+\.?\d*|\.\d+))?")
        elif len(text) < 2:
            return b"error\r\n" if text else b""
        return b"ok\r\n"

    def _jog(self, text, pattern):
        """[ino] handleJog: replaces the move under way; G91 counts from the place reached; F is in steps/s, 50..3000,
        from 1.2.1 on. [grbl] gcode.c, jogging.md: F per minute; G91 adds to what is under way."""
        words = {letter: float(number or 0) for letter, number in reversed(re.findall(pattern, text))}
        feed, rate = words.pop("F", 0.0), self.steps_a_second
        if self.grbl or (feed > 0 and self._release >= (1, 2, 1)):
            rate = min(feed / 60 * self.steps_per_mm, rate) if self.grbl else min(max(feed, 50.0), 3000.0)
        for letter in words.keys() & self.motors.keys():
            motor, way = self.motors[letter], words[letter] * self.steps_per_mm
            start = ("G91" in text) * (motor.target if self.grbl else self.position[letter])
            motor.rate, motor.target = rate, start + int(way + math.copysign(0.5, way))
        return b"ok\r\n"

    def _grbl_at_once(self, char):
        """[grbl] serial.c. `?`: no V, no ok (report.c; fits Avalon's pattern, [plugin]). `!` ends a jog, but holds
        an idle board: lines then wait, unanswered, for `~` (protocol.c, jogging.md)."""
        if char == 0x3F:
            x, y = (place / self.steps_per_mm for place in self.position.values())
            return f"<{self.state}|MPos:{x:.3f},{y:.3f},0.000|FS:0,0>\r\n".encode()
        if char in b"!\x85" and self.state == "Jog":
            for motor in self.motors.values():
                motor.brake()
        elif char in b"!~":
            self._held, waiting, self._line = char == 0x21, self._line, b""
            return self.hear(waiting)
        return b""

    def _grbl_line(self, line):
        """[grbl] protocol.c, system.c, gcode.c: ok if empty; a jog needs F; no homing set up; no G-code played."""
        text = re.sub(r"[\x00-\x20]", "", line).upper()
        if re.match(r"\$J=.*F[\d.]*[1-9]", text):
            return self._jog(text, r"([FXYZ])([-+]?(?:\d+\.?\d*|\.\d+))")
        return b"error:%d\r\n" % {"$J": 22, "$H": 5}.get(text[:2], 3 if text[0] == "$" else 20) if text else b"ok\r\n"


class BoardOnPty:
    """A board at the end of the line `port`, served by a thread of its own."""

    def __init__(self, board=None, greets=True):
        self.board, self.greets, self._ending = board or AdjusterBoard(), greets, threading.Event()
        self.received = self.board.received

    def __enter__(self):
        self._ends = list(pty.openpty())
        tty.setraw(self._ends[1])
        self.port, self._thread = os.ttyname(self._ends[1]), threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        return self

    def _serve(self):
        master, said = self._ends[0], self.board.boot() if self.greets else b""
        while not self._ending.is_set():
            if said and not self.board.mute and select.select([], [master], [], 0)[1]:
                os.write(master, said)  # what nobody reads is lost in the end, as on a serial line
            said = self.board.hear(os.read(master, 1024) if select.select([master], [], [], 0.01)[0] else b"")

    def pull(self, *_):
        """Pulls the cable: the other end finds the line hung up. Also the end of the `with`."""
        self._ending.set()
        self._thread.join(2)
        while self._ends:
            os.close(self._ends.pop())

    __exit__ = pull
