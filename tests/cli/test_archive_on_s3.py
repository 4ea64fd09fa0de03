"""``kochab archive`` from and to S3, which moto's server stands for; boto3 puts the frames there, pyarrow reads the rows."""

import socket
import subprocess
import sys
import time

import numpy as np
import pyarrow.fs
import pytest
from astropy.io import fits

from tests.cli.archive_inputs import archive, rows_of
from tests.cli.test_night import planted

boto3 = pytest.importorskip("boto3", reason="moto is not installed: pip install 'kochab-astro[test]'")


@pytest.fixture(scope="module")
def s3():
    """The port of a server with two buckets, and what a program needs to know of it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [sys.executable, "-m", "moto.server", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 60
    while time.monotonic() < until:
        with socket.socket() as line:
            if line.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.05)
    known = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    yield port, known
    server.terminate()
    server.wait(30)


def test_s3_holds_the_frames_and_the_table(s3, tmp_path, monkeypatch, capsys) -> None:
    from s3fs import S3FileSystem

    port, known = s3
    for name, value in known.items():
        monkeypatch.setenv(name, value)
    client = boto3.client(
        "s3",
        endpoint_url=known["AWS_ENDPOINT_URL"],
        aws_access_key_id="nobody",
        aws_secret_access_key="nothing",
        region_name="us-east-1",
    )
    for bucket in ("plates", "tables"):
        client.create_bucket(Bucket=bucket)
    planted(tmp_path, frames=3)
    dark = fits.PrimaryHDU(np.zeros((800, 1000), np.int16))
    dark.header["IMAGETYP"] = "Dark Frame"
    dark.writeto(tmp_path / "dark.fits")
    for file in tmp_path.glob("*.fits"):
        client.upload_file(str(file), "plates", f"2026/{file.name}")

    def asked(*arguments) -> dict:
        S3FileSystem.clear_instance_cache()  # as another process would begin
        return archive(capsys, *arguments, "--workers", "1")

    assert asked("s3://plates", "--out", "s3://tables/night")["solved"] == 3
    storage = pyarrow.fs.S3FileSystem(
        access_key="nobody", secret_key="nothing", endpoint_override=f"127.0.0.1:{port}", scheme="http"
    )
    rows = rows_of("tables/night", filesystem=storage)
    # Of a dark only the header is fetched.
    assert (rows["dark.fits"]["kind"], rows["dark.fits"]["read_bytes"]) == ("calibration", 28800)
    assert rows.pop("dark.fits")["size_bytes"] == (tmp_path / "dark.fits").stat().st_size
    assert [row["url"] for row in rows.values()] == [f"s3://plates/2026/light_{k:02d}.fits" for k in range(3)]
    assert all(row["solved"] and row["read_bytes"] == row["size_bytes"] > 0 for row in rows.values())
    keys = [found["Key"] for found in client.list_objects_v2(Bucket="tables")["Contents"]]
    assert sorted(key.partition("-")[0] for key in keys) == [
        "night/_kochab/run",
        "night/_kochab/status.html",
        "night/part",
    ]
    # An object that is put again has another ETag, if it has another content.
    client.upload_file(str(tmp_path / "light_00.fits"), "plates", "2026/light_00.fits")
    client.upload_file(str(tmp_path / "light_00.fits"), "plates", "2026/light_01.fits")
    told = asked("s3://plates/2026/*.fits", "--out", "s3://tables/night")
    assert (told["before"], told["done"]) == (3, 1)
    assert rows_of("tables/night", filesystem=storage)["light_01.fits"]["copy"]
    assert asked("status", "s3://tables/night")["rows"] == 4
