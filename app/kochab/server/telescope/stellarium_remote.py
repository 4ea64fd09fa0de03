"""Stellarium's Remote Control plug-in: its view follows the telescope, and the object selected there is the target.

Kochab is the client here and asks Stellarium, by default on this computer alone. The view is turned when the telescope
has moved, and left alone once a person has moved it: one can look around and select what comes next. What is selected
moves no mount. Facts: "RemoteControl plugin HTTP API description" of Stellarium's developers; positions are J2000.
"""

import json
import math
import threading
from base64 import b64encode
from http.client import HTTPException
from time import monotonic
from typing import Any
from urllib.parse import urlencode

import numpy as np

from kochab.core.attitude import Degrees, apart_deg, radec_deg, unit_vectors
from kochab.core.errors import UsageError
from kochab.core.mount import SIDEREAL_DEG_S
from kochab.core.values import frozen
from kochab.gear.servers.address import NetAddress, net_address, server_text
from kochab.gear.servers.deadline_http import DeadlineConnection
from kochab.parsing.text_input import TextError, parse_json
from kochab.text.translation import tr, tr_noop
from kochab.workflows.goto_target import Target
from kochab.workflows.telescope.offered import OfferedTelescope

PORT = 8090
WHO = "Stellarium Remote Control"
EVERY_S, AGAIN_S, ANSWER_S, JOIN_S = 0.5, 5.0, 4.0, 0.5
LARGEST_BYTES = 256_000
MOVED_DEG = 1.0 / 30.0
"""The view is not turned for less: a standing telescope's solves scatter."""
ABSENT = tr_noop("No Stellarium at {server}: start it and switch on its plug-in Remote Control. Kochab keeps trying.")
PASSWORD = tr_noop("Stellarium at {server} wants its password: give the address as :PASSWORD@{server}.")
STRANGE = tr_noop("{server} is not Stellarium's Remote Control. Kochab keeps trying.")


class _Unanswered(Exception):  # noqa: N818 (ends a turn; its text is for a person)
    """Nobody answered as Stellarium does."""


@frozen
class RemoteAddress:
    """Where Stellarium is, and its password, if it has one."""

    where: NetAddress
    password: str = ""


def remote_address(text: str) -> RemoteAddress:
    """``[http://][:PASSWORD@]HOST[:PORT]``; nothing means this computer. Raises `UsageError` for a path behind it."""
    password, _, server = text.strip().removeprefix("http://").rpartition("@")
    where = net_address(server, PORT)
    if where.rest:
        raise UsageError("{text} is not an address of Stellarium: write it as HOST:{port}.", text=server, port=PORT)
    return RemoteAddress(NetAddress(where.host.replace("localhost", "127.0.0.1"), where.port), password.lstrip(":"))


class StellariumRemote:
    """Turns Stellarium's view and takes its selection, in a thread of its own until :meth:`stop`.

    Parameters
    ----------
    telescope : OfferedTelescope
        What is shown there, and what gets the target.
    address : RemoteAddress
        Where Stellarium answers.
    """

    def __init__(self, telescope: OfferedTelescope, address: RemoteAddress) -> None:
        self._telescope, self._address = telescope, address
        self._shown: Degrees | None = None
        self._shown_s = 0.0
        self._selected: Target | None = None
        self._there = False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kochab-stellarium-remote", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ask and turn no more; a question under way to a Stellarium that hangs ends by itself."""
        self._over.set()
        self._thread.join(JOIN_S)

    def _run(self) -> None:
        last_error = ""
        while not self._over.is_set():
            try:
                self._turn()
                last_error = ""
            except _Unanswered as error:
                self._shown = None
                if self._there:
                    self._there = False
                    self._telescope.leave(WHO)
                elif str(error) != last_error:
                    self._telescope.say(str(error))
                    last_error = str(error)
            self._over.wait(EVERY_S if self._there else AGAIN_S)
        if self._there:
            self._telescope.leave(WHO)

    def _turn(self) -> None:
        """Once both ways: what is selected there, and where the telescope points."""
        selected = self._selection()
        if not self._there:
            self._there = True
            self._telescope.join(WHO)
            if self._telescope.target is not None:
                self._selected = selected  # from before: the target that a person has set here stays
        if selected is not None and not _same(selected, self._selected):
            self._telescope.target = selected
            self._telescope.say(tr("{who} set a target: {name}.", who=WHO, name=selected.name))
        self._selected = selected
        seen = self._telescope.seen
        if seen is None or seen.past:
            return
        if self._shown is None or apart_deg(self._shown, seen.icrs_deg) > MOVED_DEG or self._drifted(self._shown):
            self._ask("/api/main/view", {"j2000": json.dumps([float(x) for x in unit_vectors(*seen.icrs_deg)])})
            self._shown, self._shown_s = seen.icrs_deg, monotonic()

    def _drifted(self, shown: Degrees) -> bool:
        """Whether the sky has turned away below a view that nobody else has moved: it is fixed to the horizon there."""
        status, body = self._ask("/api/main/view")
        try:
            x, y, z = (float(part) for part in parse_json(parse_json(body)["j2000"]))
            away = apart_deg(radec_deg(np.array([x, y, z]) / math.hypot(x, y, z)), shown)
        except (TextError, ValueError, TypeError, ArithmeticError, LookupError):
            return False  # an older plug-in cannot tell
        turned = SIDEREAL_DEG_S * (monotonic() - self._shown_s)
        return status == 200 and MOVED_DEG < away < turned + MOVED_DEG

    def _selection(self) -> Target | None:
        """What is selected there; None when nothing is."""
        try:
            status, body = self._ask("/api/objects/info?format=json")
            if status != 200:
                return None  # "no current selection"
            found = parse_json(body)
            ra, dec = float(found["raJ2000"]) % 360.0, float(found["decJ2000"])
            name = found.get("localized-name") or found.get("name") or ""
            if abs(dec) > 90.0 or not isinstance(name, str):
                raise ValueError
        except (TextError, ValueError, TypeError, AttributeError, LookupError):
            raise _Unanswered(tr(STRANGE, server=self._address.where.server)) from None
        return Target(server_text(name) or tr("Stellarium's selection"), ra, dec)

    def _ask(self, path: str, form: dict[str, str] | None = None) -> tuple[int, bytes]:
        """GET, or POST a form; a whole answer within :data:`ANSWER_S`, or _Unanswered."""
        where = self._address.where
        line = DeadlineConnection(where.host.strip("[]"), where.port)
        line.deadline_s = monotonic() + ANSWER_S
        headers: dict[str, Any] = {"Connection": "close"}
        if self._address.password:
            headers["Authorization"] = "Basic " + b64encode(f":{self._address.password}".encode()).decode()
        if form is not None:
            headers["Content-Type"] = "application/x-www-form-urlencoded"
        try:
            line.request("GET" if form is None else "POST", path, urlencode(form) if form else None, headers)
            answer = line.getresponse()
            body = answer.read(LARGEST_BYTES)
        except HTTPException:
            raise _Unanswered(tr(STRANGE, server=where.server)) from None
        except OSError:
            raise _Unanswered(tr(ABSENT, server=where.server)) from None
        finally:
            line.close()
        if answer.status == 401:
            raise _Unanswered(tr(PASSWORD, server=where.server))
        return answer.status, body


def _same(one: Target, other: Target | None) -> bool:
    """Whether it is the same object: planets move, and stars without a name share theirs."""
    return (
        other is not None
        and one.name == other.name
        and apart_deg((one.ra_deg, one.dec_deg), (other.ra_deg, other.dec_deg)) < 1.0
    )
