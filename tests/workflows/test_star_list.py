"""Star lists as people write them, and one clear sentence when they cannot be used."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.errors import UsageError
from kochab.workflows.solve_frame import read_star_list


def read(tmp_path, text, width=100, height=80):
    path = tmp_path / "stars.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_star_list(path, width, height)


@pytest.mark.parametrize(
    "text",
    [
        "1,2\n3.5,4\n",
        "x,y\n1,2\n3.5,4\n",
        "X; Y\r\n1; 2\r\n3.5; 4\r\n",
        "# made by hand\n\n1\t2\n  3.5   4  # the second\n",
        "\ufeffx,y\n1,2\n3.5,4",
        '"x","y"\n"1","2"\n"3.5","4"\n',
        "id,x,y,note\na,1,2,\nb,3.5,4,faint\n",
        "column,row\n1,2\n3.5,4\n",
        "1,2\n3.5,4\n1,2\n",
    ],
)
def test_without_flux_the_order_stands(tmp_path, text) -> None:
    stars = read(tmp_path, text)
    assert stars.xy.tolist() == [[1.0, 2.0], [3.5, 4.0]]
    assert (stars.width, stars.height) == (100, 80)


@pytest.mark.parametrize("text", ["1,2,5\n3.5,4,9\n", "flux,y,x\n5,2,1\n9,4,3.5\n"])
def test_flux_puts_the_brightest_first(tmp_path, text) -> None:
    stars = read(tmp_path, text)
    assert stars.xy.tolist() == [[3.5, 4.0], [1.0, 2.0]]
    assert stars.flux.tolist() == [9.0, 5.0]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "has no stars"),
        ("# nothing\n\n", "has no stars"),
        ("x,y\n", "has no stars"),
        ("1\n2\n", "line 1 has 1 column; a star is x,y or x,y,flux"),
        ("1,2,3,4\n", "line 1 has 4 columns"),
        ("1,2\n3,4,5\n", "some stars have a flux"),
        ("1,2\n3,nan\n", "line 2: 'nan' is not a number"),
        ("1,2\n3,\n", "line 2: '' is not a number"),
        ("1,2\n3,inf\n", "'inf' is not a number"),
        ("1,2\nabc,4\n", "line 2: 'abc' is not a number"),
        ("1,2,nan\n", "'nan' is not a number"),
        ("x,y,flux\n1,2\n", "line 2 has fewer columns than the header"),
        ("a,b,c,d\n1,2,3,4\n", "names no columns x and y"),
        ("1,2\n500,4\n", r"line 2: \(500, 4\) is outside the 100 x 80 frame"),
        ("1,2\n5,-40\n", "outside"),
        (b"\xfd\xfe\x00\x01", "not a text file"),
        (b"1,2\n\x00\n", "not a text file"),
    ],
)
def test_one_sentence_when_it_cannot_be_used(tmp_path, text, sentence) -> None:
    with pytest.raises(UsageError, match=sentence) as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith(".")


def test_no_file_and_no_folder(tmp_path) -> None:
    with pytest.raises(UsageError, match="cannot be read: No such file"):
        read_star_list(tmp_path / "none.csv", 10, 10)
    with pytest.raises(UsageError, match="cannot be read"):
        read_star_list(tmp_path, 10, 10)


@given(
    st.lists(
        st.tuples(st.floats(0, 99), st.floats(0, 79), st.floats(-1e9, 1e9)),
        min_size=1,
        max_size=30,
        unique_by=lambda s: s[:2],
    )
)
def test_what_is_written_is_read(tmp_path_factory, stars) -> None:
    text = "\n".join(",".join(repr(v) for v in star) for star in stars)
    found = read(tmp_path_factory.mktemp("list"), text)
    assert len(found) == len(stars)
    assert (np.diff(found.flux) <= 0).all()
    assert {tuple(p) for p in found.xy.tolist()} == {s[:2] for s in stars}


@given(st.binary(max_size=200))
def test_any_bytes_give_stars_or_a_sentence(tmp_path_factory, data) -> None:
    with suppress(UsageError):  # nothing else may come out
        stars = read(tmp_path_factory.mktemp("list"), data)
        assert len(stars) > 0
        assert np.isfinite(stars.xy).all()
