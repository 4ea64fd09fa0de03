import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kochab.identification.quads import canonical, planar, with_variants

coordinate = st.floats(-1.0, 1.0, allow_nan=False, width=32)
quad = st.lists(st.tuples(coordinate, coordinate), min_size=4, max_size=4).map(
    lambda p: np.array([complex(*q) for q in p])
)


def usable(z):
    d = np.abs(z[:, None] - z[None])[np.triu_indices(4, 1)]
    return d.min() > 0.02


@given(quad, st.permutations(range(4)), st.floats(0, 6.28), st.floats(0.1, 50), st.booleans())
def test_shape_does_not_depend_on_order_place_turn_scale_or_mirror(z, order, turn, scale, mirror):
    if not usable(z):
        return
    other = z[list(order)] * scale * complex(np.cos(turn), np.sin(turn)) + (3 - 2j)
    if mirror:
        other = other.conj()
    tolerance = np.array([1e-9])
    a = with_variants(z[None], tolerance).code
    b = canonical(other[None]).code
    assert np.abs(a - b).max(axis=1).min() < 1e-6


@given(quad)
def test_canonical_codes_lie_in_the_fundamental_region(z):
    if not usable(z):
        return
    c = canonical(z[None]).code[0]
    assert c[0] <= c[1]
    assert c[0] + c[1] <= 1 + 1e-12
    assert c[2] + c[3] >= -1e-12
    assert np.abs(c[2:]).max() <= np.sqrt(0.75) + 1e-9


@given(quad, st.integers(0, 2**31))
@settings(max_examples=200)
def test_a_measured_shape_is_found_among_the_variants(z, seed):
    """However the error folds the code, one of the variants is near the true one."""
    if not usable(z):
        return
    base = np.abs(z[:, None] - z[None]).max()
    error = 1e-3 * base
    rng = np.random.default_rng(seed)
    noise = (rng.uniform(-1, 1, 4) + 1j * rng.uniform(-1, 1, 4)) * error / 3
    true = canonical(z[None]).code[0]
    tolerance = np.array([4 * error / base])
    found = with_variants((z + noise)[None], tolerance)
    assert np.abs(found.code - true).max(axis=1).min() < tolerance[0]


def test_order_and_parity_tell_which_star_is_which():
    z = np.array([0.1 + 0.2j, 0.9 + 0.1j, 0.3 + 0.5j, 0.6 - 0.1j])
    a, b = canonical(z[None]), canonical(z[[2, 0, 3, 1]].conj()[None])
    assert (z[a.order[0]] == z[[2, 0, 3, 1]][b.order[0]]).all()
    assert a.mirrored[0] != b.mirrored[0]


def test_the_sphere_and_the_picture_agree_on_shape_and_handedness():
    rng = np.random.default_rng(2)
    pixels = rng.uniform(-1e-3, 1e-3, (50, 4, 2))
    seen = np.concatenate([pixels, np.ones((50, 4, 1))], axis=2)
    sky = Rotation.random(random_state=3).apply((seen / np.linalg.norm(seen, axis=2, keepdims=True)).reshape(-1, 3))
    a = canonical(planar(sky.reshape(50, 4, 3)))
    b = canonical(pixels[..., 0] + 1j * pixels[..., 1])
    np.testing.assert_allclose(a.code, b.code, atol=1e-5)
    assert (a.mirrored == b.mirrored).all()
