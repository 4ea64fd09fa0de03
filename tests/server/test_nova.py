"""nova.astrometry.net's API on this computer: what its clients ask, and what others must not get."""

import http.client
import io
import json
import os
import shutil
import socket
import stat
import subprocess
import sys
import time
import uuid
from pathlib import Path

import numpy as np
import pytest
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.wcs import WCS

import kochab
from kochab.core.errors import UsageError
from kochab.server import nova as nova_module
from kochab.server.http_server import MOST_BYTES, HttpServer, parse_form
from kochab.server.nova import Nova

SAMPLES = Path(__file__).resolve().parents[2] / "resources" / "samples"
KEY = "0123456789abcdef0123456789abcdef"
ORION = SkyCoord(84.0, -1.5, unit="deg")


@pytest.fixture(scope="module")
def server():
    nova = Nova(KEY)
    http_server = HttpServer(nova.answer)
    yield http_server
    http_server.stop()
    nova.close()


class Client:
    """What a program of the API does, with the library's own HTTP."""

    def __init__(self, server, host=None):
        self.address, self.host = server.address, host

    def ask(self, method, path, body=None, headers=()):
        line = http.client.HTTPConnection(*self.address, timeout=60)
        more = dict(headers) | ({"Host": self.host} if self.host else {})
        line.request(method, path, body, more)
        answer = line.getresponse()
        content = answer.read()
        line.close()
        return answer.status, dict(answer.getheaders()), content

    def get(self, path):
        return json.loads(self.ask("GET", path)[2])

    def post(self, path, asked, file=None):
        border = uuid.uuid4().hex
        parts = [
            f'--{border}\r\nContent-Disposition: form-data; name="request-json"\r\n\r\n{json.dumps(asked)}\r\n'.encode()
        ]
        if file is not None:
            head = f'--{border}\r\nContent-Disposition: form-data; name="file"; filename="{file[0]}"\r\n\r\n'
            parts += [head.encode(), file[1], b"\r\n"]
        body = b"".join([*parts, f"--{border}--\r\n".encode()])
        return json.loads(self.ask("POST", path, body, {"Content-Type": f"multipart/form-data; boundary={border}"})[2])

    def session(self):
        return self.post("/api/login", {"apikey": KEY})["session"]

    def solved(self, file=None, **settings):
        """The job's number once it is done."""
        sent = self.post("/api/upload", {"session": self.session(), **settings}, file)
        assert sent["status"] == "success", sent
        for _ in range(2000):
            found = self.get(f"/api/submissions/{sent['subid']}")
            if found["processing_finished"] != "None":
                return found["jobs"][0]
            time.sleep(0.05)
        raise AssertionError(found)


@pytest.fixture
def client(server):
    return Client(server)


@pytest.fixture(scope="module")
def job(server):
    client = Client(server)
    return client.solved(
        ("orion.png", (SAMPLES / "orion.png").read_bytes()), scale_units="degwidth", scale_lower=10, scale_upper=20
    )


def test_a_submission_is_solved_and_its_answers_agree(client, job) -> None:
    assert 0 < job < 2**31  # StellarSolver reads it into a C int
    assert client.get(f"/api/jobs/{job}") == {"status": "success"}
    found = client.get(f"/api/jobs/{job}/calibration/")
    assert SkyCoord(found["ra"], found["dec"], unit="deg").separation(ORION).deg < 0.01
    assert found["pixscale"] == pytest.approx(50.2, abs=0.2)
    assert found["width_arcsec"] == pytest.approx(15 * 3600, rel=0.002)
    # Debian's solve-field on this image: up is -168.08 degrees E of N at its reference point, parity neg.
    assert found["orientation"] == pytest.approx(-168.08, abs=0.5)
    assert found["parity"] == 1.0
    info = client.get(f"/api/jobs/{job}/info/")
    assert info["status"] == "success"
    assert info["original_filename"] == "orion.png"
    assert "M 42" in info["objects_in_field"]
    assert {key: info["calibration"][key] for key in found} == found
    assert client.get(f"/api/jobs/{job}/objects_in_field/") == {"objects_in_field": info["objects_in_field"]}
    marked = {one["names"][0]: one for one in client.get(f"/api/jobs/{job}/annotations/")["annotations"]}
    header = fits.Header.fromstring(client.ask("GET", f"/wcs_file/{job}")[2].decode())
    del header["NAXIS"]  # there is no image in it, which astropy would remark upon
    wcs = WCS(header)
    x, y = wcs.world_to_pixel(SkyCoord("05h35m17.3s", "-05d23m28s"))
    assert np.hypot(marked["M 42"]["pixelx"] - 1 - x, marked["M 42"]["pixely"] - 1 - y) < 3
    assert marked["M 42"]["radius"] > 10


@pytest.mark.parametrize(
    "names", [("X_IMAGE", "Y_IMAGE", "MAG_AUTO"), ("X", "Y", "FLUX"), ("X", "Y", "Z")], ids=lambda names: names[2]
)
def test_an_uploaded_table_is_a_list_of_stars(client, names) -> None:
    """As StellarSolver uploads what it has detected itself: the columns of SExtractor."""
    stars = kochab.detect(SAMPLES / "orion.png")
    light = -2.5 * np.log10(stars.flux) if names[2] == "MAG_AUTO" else stars.flux
    arrays = [stars.xy[:, 0] + 1, stars.xy[:, 1] + 1, light]
    turn = slice(None, None, 1 if names[2] == "Z" else -1)  # sorted by the third where it says how
    columns = [fits.Column(name, "1E", array=array[turn]) for name, array in zip(names, arrays, strict=True)]
    file = io.BytesIO()
    fits.BinTableHDU.from_columns(columns).writeto(file)
    job = client.solved(("k.fits", file.getvalue()), image_width=stars.width, image_height=stars.height)
    found = client.get(f"/api/jobs/{job}/calibration/")
    assert SkyCoord(found["ra"], found["dec"], unit="deg").separation(ORION).deg < 0.01


def test_a_list_of_stars_has_the_size_of_its_image_and_counts_pixels_from_one() -> None:
    given = {"image_width": 640, "image_height": 480, "x": [1.0, 640.0], "y": [1.0, 480.0]}
    stars = nova_module.star_list(given)
    assert (stars.width, stars.height) == (640, 480)
    assert stars.xy.tolist() == [[0.0, 0.0], [639.0, 479.0]]
    for wrong in ({"x": None}, {"y": [1.0]}, {"x": [1.0, float("nan")]}, {"image_width": None}, {"x": [], "y": []}):
        with pytest.raises(UsageError):
            nova_module.star_list(given | wrong)


@pytest.mark.parametrize("known", [("image_width", "image_height"), ("image_width",), ("image_height",), ()])
def test_a_table_of_stars_is_a_list_where_the_size_of_its_image_is_given(tmp_path, known) -> None:
    columns = [fits.Column(name, "1E", array=[300.0, 200.0, 100.0]) for name in ("X", "Y", "FLUX")]
    fits.BinTableHDU.from_columns(columns).writeto(tmp_path / "stars.fits")
    size = {"image_width": 640, "image_height": 480}
    stars = nova_module._table(tmp_path / "stars.fits", {name: size[name] for name in known})
    assert (stars and (stars.width, stars.height)) == ((640, 480) if len(known) == 2 else None)


def test_a_program_with_a_key_of_its_own_may_be_let_in(tmp_path, monkeypatch) -> None:
    """EXOTIC has one built in: its address is changed alone."""
    for any_key, status in ((False, "error"), (True, "success")):
        nova = Nova(KEY, any_key)
        http_server = HttpServer(nova.answer)
        try:
            assert Client(http_server).post("/api/login", {"apikey": "vfsyxlmdxfryhprq"})["status"] == status
        finally:
            http_server.stop()
            nova.close()
    asked = [sys.executable, "-m", "kochab", "serve", "--nova", "--any-key", "--lan"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "not with --lan" in done.stderr


def test_a_job_has_a_log(client, job) -> None:
    """StellarSolver takes it, and gives up where there is none."""
    code, _, text = client.ask("GET", f"/joblog/{job}")
    assert code == 200
    assert b"Field center: (RA,Dec) = (84.0000" in text
    failed = client.solved(("a.fits", b"SIMPLE  =" + bytes(5000)))
    assert b"Did not solve" in client.ask("GET", f"/joblog/{failed}")[2]
    assert client.ask("GET", "/joblog/12")[0] == 404


@pytest.mark.parametrize("what", ["wcs_file", "new_fits_file", "rdls_file", "axy_file", "corr_file"])
def test_files_are_fits_that_astropy_reads(client, job, what) -> None:
    status, headers, content = client.ask("GET", f"/{what}/{job}")
    assert status == 200
    assert what in headers["Content-Disposition"]
    with fits.open(io.BytesIO(content)) as file:
        if what == "new_fits_file":
            assert file[0].data.shape == (720, 1080)
        if what in ("wcs_file", "new_fits_file"):
            assert file[0].header["CTYPE1"].startswith("RA---TAN")
        else:
            assert len(file[1].data) > 50


def test_the_annotated_image_is_a_picture(client, job) -> None:
    from PIL import Image

    status, headers, content = client.ask("GET", f"/annotated_display/{job}")
    assert (status, headers["Content-Type"]) == (200, "image/jpeg")
    assert Image.open(io.BytesIO(content)).size == (1080, 720)


def test_a_list_of_stars_is_solved(client, job) -> None:
    stars = fits.getdata(io.BytesIO(client.ask("GET", f"/axy_file/{job}")[2]))
    lists = {"x": stars["X"].tolist(), "y": stars["Y"].tolist(), "image_width": 1080, "image_height": 720}
    number = client.solved(**lists, center_ra=84, center_dec=-2, radius=5)
    found = client.get(f"/api/jobs/{number}/calibration")
    assert SkyCoord(found["ra"], found["dec"], unit="deg").separation(ORION).deg < 0.01
    assert client.ask("GET", f"/annotated_display/{number}")[0] == 404  # no image


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"scale_units": "arcsecperpix", "scale_lower": 70, "scale_upper": 90}, "field of view differs"),
        ({"scale_type": "ev", "scale_est": 30, "scale_err": 10}, "field of view differs"),
        ({"center_ra": 84, "center_dec": 40, "radius": 5}, "outside the search radius"),
    ],
)
def test_bounds_are_kept_and_the_reason_is_told(client, settings, why) -> None:
    number = client.solved(("a.png", (SAMPLES / "orion.png").read_bytes()), **settings)
    told = client.get(f"/api/jobs/{number}")
    assert told["status"] == "failure"
    assert why in told["reason"]
    assert why in client.get(f"/api/submissions/{number}")["error_message"]
    assert "error" in client.get(f"/api/jobs/{number}/calibration/")
    assert client.ask("GET", f"/wcs_file/{number}")[0] == 404


@pytest.mark.parametrize("content", [b"", b"no image", b"SIMPLE  =" + bytes(3000), b"\x89PNG\r\n\x1a\n" + bytes(100)])
def test_what_is_no_image_fails_with_a_sentence(client, content) -> None:
    number = client.solved(("../../etc/a.fits\\b.png", content))
    told = client.get(f"/api/jobs/{number}/info/")
    assert told["status"] == "failure"
    assert told["original_filename"] == "b.png"
    assert client.get(f"/api/jobs/{number}")["reason"].endswith(".")


@pytest.mark.parametrize(
    ("path", "asked", "message"),
    [
        ("/api/login", {"apikey": "wrong"}, "bad apikey"),
        ("/api/login", {}, "bad apikey"),
        ("/api/login", [1], "no json"),
        ("/api/upload", {}, "no session: log in first"),
        ("/api/upload", {"session": "guess"}, "no session: log in first"),
        ("/api/url_upload", {"session": None, "url": "http://elsewhere/a.jpg"}, "Kochab fetches nothing"),
        ("/api/upload", {"session": None}, "no file, and no lists"),
        ("/api/upload", {"session": None, "x": [1], "y": ["a"]}, "no file, and no lists"),
        ("/api/upload", {"session": None, "x": [1], "y": [2]}, "a list of stars needs"),
        ("/api/upload", {"session": None, "scale_units": "furlongs"}, "furlongs is none of the units"),
        ("/api/upload", {"session": None, "scale_lower": "wide"}, "scale_lower is not a number"),
    ],
)
def test_what_is_refused_is_said_in_words(client, path, asked, message) -> None:
    if isinstance(asked, dict) and "session" in asked and asked["session"] is None:
        asked = {**asked, "session": client.session()}
    told = client.post(path, asked)
    assert told["status"] == "error"
    assert told["errormessage"].startswith(message)


@pytest.mark.parametrize(
    "path",
    [
        *("/", "/api", "/api/jobs/1", "/api/jobs/x", "/api/jobs/", "/api/jobs/%C2%B2", "/wcs_file/1", "//", "/%2e%2e/"),
        *("/wcs_file/../../etc/passwd", "/etc/passwd", "/" + "0" * 32 + "/", f"/{KEY[:-1]}/"),
        "/api/submissions/" + "9" * 400,
    ],
)
def test_nothing_else_is_there(client, path) -> None:
    assert client.ask("GET", path)[0] == 404


def test_an_address_with_too_many_fields_is_refused(client) -> None:
    assert client.ask("GET", "/api/jobs/1?" + "a=1&" * 50)[0] == 400


def test_another_name_for_this_host_is_refused(server) -> None:
    assert Client(server, "evil.example").ask("GET", f"/{KEY}/")[0] == 421
    assert Client(server, f"localhost:{server.address[1]}").ask("GET", f"/{KEY}/")[0] == 200


def test_the_page_has_a_session_and_loads_nothing_from_elsewhere(client) -> None:
    status, headers, content = client.ask("GET", f"/{KEY}/")
    assert status == 200
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    text = content.decode()
    assert "http" not in text.replace("http-equiv", "")
    session = text.split('data-session="')[1].split('"')[0]
    assert client.post("/api/upload", {"session": session})["errormessage"].startswith("no file")


def test_sizes_are_bounded(client, server) -> None:
    assert client.ask("POST", "/api/upload", None, {"Content-Length": str(MOST_BYTES + 1)})[0] == 413
    assert client.ask("POST", "/api/upload", None, {"Content-Length": "-5"})[0] == 411
    assert client.ask("POST", "/api/upload", None, {"Content-Length": "1" * 30})[0] == 411
    with socket.create_connection(server.address) as rude:
        rude.sendall(b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n")
        assert b" 414 " in rude.recv(100)


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("multipart/form-data; boundary=x", b"--x\r\n"),
        ("multipart/form-data; boundary=x", b"--x--x--x--x"),
        ("multipart/form-data", b"--x\r\n\r\n--x--"),
        ("application/x-www-form-urlencoded", b"a=1&" * 100),
        ("application/x-www-form-urlencoded", b"\xff\xfe=\x00"),
    ],
)
def test_forms_that_are_none_are_empty_or_harmless(kind, body) -> None:
    form, file = parse_form(kind, body)
    assert "request-json" not in form
    assert file is None


def test_the_oldest_go_where_there_are_too_many(monkeypatch) -> None:
    monkeypatch.setattr(nova_module, "MOST_JOBS", 2)
    nova = Nova(KEY)
    server = HttpServer(nova.answer)
    try:
        client = Client(server)
        numbers = [client.solved((f"{i}.png", b"none")) for i in range(4)]
        assert [client.ask("GET", f"/api/jobs/{n}")[0] for n in numbers] == [404, 404, 200, 200]
        assert len([*Path(nova._folder.name).iterdir()]) == 2
    finally:
        server.stop()
        folder = Path(nova._folder.name)
        nova.close()
    assert not folder.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="asks for POSIX signals and modes")
def test_the_command_tells_the_address_and_keeps_the_key(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    told = []
    for more in ([], [], ["--new-key"]):
        process = subprocess.Popen(
            [sys.executable, "-m", "kochab", "serve", "--nova", "--port", port, *more],
            stdout=subprocess.PIPE,
            text=True,
        )
        lines = [process.stdout.readline() for _ in range(4)]
        if not more:
            with socket.create_connection(("127.0.0.1", int(port))):
                pass
        process.terminate()
        assert process.wait(60.0) == 130
        process.stdout.close()
        assert lines[0].endswith(f": http://127.0.0.1:{port}\n")
        told.append(lines[1])
    assert told[0] == told[1] != told[2]
    assert stat.S_IMODE((tmp_path / "nova-key").stat().st_mode) == 0o600


# Of astroquery 0.4.11: what it makes of the argument is its default from then on, and before it was not.
@pytest.mark.filterwarnings("ignore:.*force_image_upload", "ignore:The WCS transformation has more axes")
def test_astroquery_solves_with_its_address_changed_alone(server) -> None:
    astrometry_net = pytest.importorskip("astroquery.astrometry_net", reason="astroquery is not installed")
    client = astrometry_net.AstrometryNet()
    client.URL = "http://{}:{}".format(*server.address)
    client.API_URL, client.api_key = f"{client.URL}/api", KEY
    header = client.solve_from_image(str(SAMPLES / "orion.png"), force_image_upload=True, verbose=False)
    assert WCS(header, naxis=2).pixel_to_world(539.5, 359.5).separation(ORION).deg < 0.01


CHROMIUM = shutil.which("chromium")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium is installed")
def test_a_browser_shows_the_page(server, tmp_path) -> None:
    """Its scripts run under its own rules: the text of the title and of the place to drop on is there."""
    root = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
    url = "http://{}:{}/{}/".format(*server.address, KEY)
    asked = [CHROMIUM, "--headless=new", "--disable-gpu", *root, f"--user-data-dir={tmp_path}", "--dump-dom", url]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=200)
    assert "Drop images here" in done.stdout
