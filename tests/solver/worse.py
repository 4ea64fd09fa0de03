"""Real frames made worse in one known way, for the doctor's reasons.

``python -m tests.solver.worse FOLDER [COUNT [SEED [STRENGTH [unseen]]]]`` makes the real frames of a folder worse in every
way until COUNT of them (200) have no solution, and prints which reasons were given for what was done. STRENGTH (1)
is of trails, discs and the Moon: 0.5 is half as large. With ``unseen`` these are ways that the doctor's rules were not
written from.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from kochab.core.frame import Frame, Hint
from kochab.core.progress import run
from kochab.core.solution import NoSolution, Reason
from kochab.frames import read_frame
from kochab.solver import SolveOptions
from kochab.solver.pipeline import solve_frame


def _levels(frame: Frame) -> tuple[np.ndarray, float, float, float]:
    """Pixels as floats, their clipping level, background and noise."""
    pixels = frame.pixels.astype(np.float32)
    whole = frame.pixels.dtype.kind in "iu"
    clip = float(frame.saturation or (np.iinfo(frame.pixels.dtype).max if whole else np.nanmax(pixels)))
    sky = float(np.nanmedian(pixels))
    noise = max(1.4826 * float(np.nanmedian(np.abs(pixels - sky))), 0.004 * clip)
    return np.nan_to_num(pixels, nan=sky), clip, sky, noise


def _with(frame: Frame, pixels: np.ndarray, clip: float, hint: Hint | None = None) -> Frame:
    pixels = np.clip(pixels, 0, clip)
    if frame.pixels.dtype.kind in "iu":
        pixels = np.round(pixels)
    return replace(frame, pixels=np.ascontiguousarray(pixels.astype(frame.pixels.dtype)), hint=hint or Hint())


def _blurred(frame: Frame, kernel: np.ndarray, rng: np.random.Generator) -> Frame:
    """The light spread by a kernel, the read-out's noise as it was."""
    from scipy.signal import oaconvolve

    pixels, clip, sky, noise = _levels(frame)
    light = oaconvolve(pixels - sky, (kernel / kernel.sum()).astype(np.float32), mode="same")
    return _with(frame, sky + 6.0 * light + rng.normal(0.0, noise, pixels.shape), clip)


def trailed(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A mount that moved while the shutter was open."""
    length, angle = strength * rng.uniform(0.03, 0.06) * frame.width, rng.uniform(0.0, np.pi)
    half = int(np.ceil(length / 2.0)) + 1
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    along, across = x * np.cos(angle) + y * np.sin(angle), -x * np.sin(angle) + y * np.cos(angle)
    return _blurred(frame, ((np.abs(across) < 1.0) & (np.abs(along) < length / 2.0)) * 1.0, rng)


def defocused(frame: Frame, rng: np.random.Generator, strength: float = 1.0, hole: float = 0.0) -> Frame:
    """Stars as discs of some 40 px."""
    radius = strength * rng.uniform(16.0, 24.0)
    half = int(radius) + 1
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    away = np.hypot(x, y)
    return _blurred(frame, ((away < radius) & (away >= hole * radius)) * 1.0, rng)


def ringed(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """The same through a telescope whose secondary mirror makes a hole in them."""
    return defocused(frame, rng, strength, 0.4)


def bright_sky(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Daylight, dusk or cloud."""
    pixels, clip, sky, noise = _levels(frame)
    day = clip * rng.uniform(0.55, 0.9)
    return _with(frame, day + 0.05 * (pixels - sky) + rng.normal(0.0, 3.0 * noise, pixels.shape), clip)


def dark(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A cap left on."""
    pixels, clip, sky, noise = _levels(frame)
    return _with(frame, min(sky, 0.2 * clip) + rng.normal(0.0, noise, pixels.shape), clip)


def few_stars(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Thin cloud: four stars are left."""
    pixels, clip, sky, noise = _levels(frame)
    out = sky + rng.normal(0.0, noise, pixels.shape).astype(np.float32)
    y, x = np.mgrid[: frame.height, : frame.width].astype(np.float32)
    for cx, cy in rng.uniform([0.1, 0.1], [0.9, 0.9], (4, 2)) * [frame.width, frame.height]:
        out += 0.4 * clip * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2.0 * 1.4**2))
    return _with(frame, out, clip)


def moonlit(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """The Moon in a halo that drowns all but a handful of stars."""
    few = few_stars(frame, rng)
    pixels, clip, _, _ = _levels(few)
    y, x = np.mgrid[: frame.height, : frame.width]
    away = np.hypot(x - rng.uniform(0.3, 0.7) * frame.width, y - rng.uniform(0.3, 0.7) * frame.height)
    radius = strength * rng.uniform(0.06, 0.12) * frame.height
    halo = 0.3 * clip / (1.0 + (away / (2.0 * radius)) ** 2)
    return _with(frame, np.where(away < radius, clip, pixels + halo), clip)


def small_field(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Ten arcminutes, told by the header."""
    out = shuffled(frame, rng)
    scale = 600.0 / frame.width
    return replace(out, hint=Hint(scale_arcsec_px=(scale / 1.1, scale * 1.1)))


def shuffled(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Healthy stars in places where there are none: tiles of the frame, exchanged and turned over."""
    pixels, clip, sky, _ = _levels(frame)
    size = max(frame.width, frame.height) // 14 // 2 * 2
    rows, columns = frame.height // size, frame.width // size
    out = pixels[: rows * size, : columns * size]
    tiles = out.reshape(rows, size, columns, size).swapaxes(1, 2).reshape(-1, size, size)
    tiles += sky - np.median(tiles, axis=(1, 2), keepdims=True)  # else their seams are lines
    tiles = np.stack([np.rot90(tile[:, ::-1], rng.integers(4)) for tile in tiles[rng.permutation(len(tiles))]])
    out = tiles.reshape(rows, columns, size, size).swapaxes(1, 2).reshape(rows * size, columns * size)
    return _with(frame, out, clip)


def satellites(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A train of satellites, parallel to a degree, over healthy stars."""
    out = shuffled(frame, rng)
    pixels, clip, _, noise = _levels(out)
    y, x = np.mgrid[: out.height, : out.width].astype(np.float32)
    direction = rng.uniform(0.0, np.pi)
    for _ in range(rng.integers(4, 12)):
        angle, off = direction + rng.normal(0.0, 0.02), rng.uniform(-0.5, 0.5) * out.height
        away = (x - out.width / 2) * np.sin(angle) - (y - out.height / 2) * np.cos(angle) - off
        pixels += rng.uniform(10.0, 60.0) * noise * np.exp(-0.5 * (away / 1.3) ** 2)
    return _with(out, pixels, clip)


def lettered(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Five lines of writing over healthy stars."""
    from PIL import Image, ImageDraw, ImageFont

    out = shuffled(frame, rng)
    pixels, clip, _, _ = _levels(out)
    sheet = Image.new("L", (out.width, out.height))
    font = ImageFont.load_default(max(10, out.height // 35))
    for line in range(5):
        place = 0.04 * out.width, (0.05 + 0.19 * line) * out.height
        ImageDraw.Draw(sheet).text(place, "Milky Way over the lake  ISO 6400  30 s  f/2.8", fill=255, font=font)
    return _with(out, np.maximum(pixels, np.asarray(sheet) / 255.0 * clip), clip)


WORSE = {
    "trailed": (trailed, {Reason.TRAILED}),
    "defocused": (defocused, {Reason.OUT_OF_FOCUS}),
    "ringed": (ringed, {Reason.OUT_OF_FOCUS}),
    "bright sky": (bright_sky, {Reason.CLOUDED_OR_DARK}),
    "dark": (dark, {Reason.CLOUDED_OR_DARK, Reason.TOO_FEW_STARS}),
    "few stars": (few_stars, {Reason.TOO_FEW_STARS}),
    "moonlit": (moonlit, {Reason.TOO_FEW_STARS}),
    "small field": (small_field, {Reason.FIELD_TOO_SMALL}),
    "shuffled": (shuffled, {Reason.NO_PATTERN_AGREED}),
    "satellites": (satellites, {Reason.NO_PATTERN_AGREED}),
    "lettered": (lettered, {Reason.NO_PATTERN_AGREED}),
}
"""What was done to the frame, and the reasons that are right."""


# -- Ways that the doctor's rules were not written from: they judge the rules -------------------


def wobbled(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A tripod pushed in mid-exposure: a curved path, slower at its ends."""
    length, angle = strength * rng.uniform(0.03, 0.06) * frame.width, rng.uniform(0.0, 2.0 * np.pi)
    bow, turn = rng.uniform(0.05, 0.2), np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    along = np.cos(np.linspace(0.0, np.pi, 40 * int(length))) / 2.0
    x, y = np.rint(length * turn @ np.stack([along, bow * np.cos(np.pi * along)])).astype(int)
    kernel = np.zeros((int(np.ptp(y)) + 1, int(np.ptp(x)) + 1))
    np.add.at(kernel, (y - y.min(), x - x.min()), 1.0)
    return _blurred(frame, kernel, rng)


def rotated(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """An alt-azimuth mount without a rotator: the field rotates about a point in it."""
    from scipy.ndimage import affine_transform

    pixels, clip, sky, noise = _levels(frame)
    pivot, light = rng.uniform(0.3, 0.7, 2) * pixels.shape, np.zeros_like(pixels)
    angles = np.radians(strength * rng.uniform(5.0, 8.0)) * np.linspace(-0.5, 0.5, 61)
    for c, s in zip(np.cos(angles), np.sin(angles), strict=True):
        turn = np.array([[c, -s], [s, c]])
        light += affine_transform(pixels - sky, turn, pivot - turn @ pivot, order=1) / len(angles)
    return _with(frame, sky + 8.0 * light + rng.normal(0.0, noise, pixels.shape), clip)


def frosted(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A lens set to its near end: wide stars without an edge."""
    sigma = strength * rng.uniform(9.0, 12.0)
    y, x = np.mgrid[-40:41, -40:41]
    return _blurred(frame, np.exp(-(x * x + y * y) / (2.0 * sigma * sigma)), rng)


def hexagonal(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A lens out of focus behind six blades."""
    radius, angle = strength * rng.uniform(14.0, 22.0), rng.uniform(0.0, np.pi)
    half = int(radius) + 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    sides = [np.abs(x * np.cos(angle + k * np.pi / 3) + y * np.sin(angle + k * np.pi / 3)) for k in range(3)]
    return _blurred(frame, (np.max(sides, axis=0) < 0.87 * radius) * 1.0, rng)


def dusk(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A bright horizon: white below, half of full scale above."""
    pixels, clip, sky, noise = _levels(frame)
    day = clip * np.linspace(rng.uniform(0.4, 0.55), 1.3, frame.height)[:, None]
    return _with(frame, day + 0.05 * (pixels - sky) + rng.normal(0.0, 2.0 * noise, pixels.shape), clip)


def glowing(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A cap left on, a warm sensor: hot pixels, and an amplifier's glow in a corner."""
    pixels, clip, sky, noise = _levels(frame)
    y, x = np.mgrid[: frame.height, : frame.width]
    glow = 0.1 * clip * np.exp(-(x + y) / (0.1 * frame.width))
    out = min(sky, 0.1 * clip) + glow + rng.normal(0.0, noise, pixels.shape)
    hot = rng.integers(0, out.size, out.size // 5000)
    out.ravel()[hot] += rng.uniform(0.05, 0.9, len(hot)) * clip
    return _with(frame, out, clip)


def faint(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Exposed far too short: a hundredth of the light in the same noise."""
    pixels, clip, sky, noise = _levels(frame)
    return _with(frame, sky + 0.01 * (pixels - sky) + rng.normal(0.0, noise, pixels.shape), clip)


def lamp(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """A street lamp at the edge, its ghosts across the frame, and four stars."""
    few = few_stars(frame, rng)
    pixels, clip, _, _ = _levels(few)
    y, x = np.mgrid[: frame.height, : frame.width]
    start, middle = (
        np.array([rng.uniform(0.1, 0.9), 0.08]) * [frame.width, frame.height],
        np.array([frame.width, frame.height]) / 2.0,
    )
    away = np.hypot(x - start[0], y - start[1])
    pixels += 0.4 * clip / (1.0 + (away / (0.05 * frame.width)) ** 2) + clip * (away < 0.05 * frame.width)
    for share in (1.3, 1.6, 1.9):
        ghost = start + share * (middle - start)
        pixels += 0.05 * clip * (np.hypot(x - ghost[0], y - ghost[1]) < 0.03 * share * frame.width)
    return _with(frame, pixels, clip)


def squeezed(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Healthy stars, saved as the poorest JPEG."""
    import io

    from PIL import Image

    out = shuffled(frame, rng)
    pixels, clip, _, _ = _levels(out)
    file = io.BytesIO()
    Image.fromarray(np.clip(255.0 * pixels / clip, 0, 255).astype(np.uint8)).save(file, "JPEG", quality=12)
    return _with(out, np.asarray(Image.open(file)) / 255.0 * clip, clip)


def meteor(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """One bright streak that swells and fades, over healthy stars."""
    out = shuffled(frame, rng)
    pixels, clip, _, _ = _levels(out)
    y, x = np.mgrid[: out.height, : out.width].astype(np.float32)
    angle, width = rng.uniform(0.0, np.pi), rng.uniform(2.0, 5.0)
    u, v = x - rng.uniform(0.3, 0.7) * out.width, y - rng.uniform(0.3, 0.7) * out.height
    along, across = u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)
    return _with(out, pixels + clip * np.exp(-((across / width) ** 2) - (along / (0.15 * out.width)) ** 2), clip)


def slit(frame: Frame, rng: np.random.Generator, strength: float = 1.0) -> Frame:
    """Healthy stars in a third of the frame: the dome is in front of the rest."""
    out = shuffled(frame, rng)
    pixels, clip, sky, noise = _levels(out)
    x = np.arange(out.width) / out.width - rng.uniform(0.2, 0.5)
    dome = 0.3 * sky + rng.normal(0.0, 0.5 * noise, pixels.shape)
    return _with(out, np.where((x > 0.0) & (x < 0.33), pixels, dome), clip)


UNSEEN = {
    "wobbled": (wobbled, {Reason.TRAILED}),
    "rotated": (rotated, {Reason.TRAILED}),
    "frosted": (frosted, {Reason.OUT_OF_FOCUS}),
    "hexagonal": (hexagonal, {Reason.OUT_OF_FOCUS}),
    "dusk": (dusk, {Reason.CLOUDED_OR_DARK}),
    "glowing": (glowing, {Reason.CLOUDED_OR_DARK, Reason.TOO_FEW_STARS}),
    "faint": (faint, {Reason.CLOUDED_OR_DARK, Reason.TOO_FEW_STARS}),
    "lamp": (lamp, {Reason.TOO_FEW_STARS}),
    "squeezed": (squeezed, {Reason.NO_PATTERN_AGREED, Reason.TOO_FEW_STARS}),
    "meteor": (meteor, {Reason.NO_PATTERN_AGREED}),
    "slit": (slit, {Reason.NO_PATTERN_AGREED, Reason.TOO_FEW_STARS}),
}
"""The same as :data:`WORSE`. A third of a small frame and the poorest JPEG leave some frames without six stars."""
EVERY = WORSE | UNSEEN


def reasons(
    folder: Path, names: list[str], seed: int = 0, strength: float = 1.0, ways: tuple[str, ...] = tuple(WORSE)
) -> Iterator[tuple[str, str, NoSolution]]:
    """Frame by frame: its name, what was done to it, and what was said of it; those solved all the same need none."""
    for number, name in enumerate(names):
        frame = read_frame(folder / name)
        for kind in ways:
            worse = EVERY[kind][0](frame, np.random.default_rng(1000 * seed + number), strength)
            answer = run(solve_frame(worse, SolveOptions(timeout_s=None)))
            if isinstance(answer, NoSolution):
                yield name, kind, answer


def main(folder: str, most: str = "200", seed: str = "0", strength: str = "1", which: str = "") -> None:
    """Print the matrix, a way of making worse a line."""
    told = json.loads(Path(folder, "truth.json").read_text("utf-8"))["frames"]
    names = sorted(name for name, truth in told.items() if "ra_deg" in truth)
    table: Counter[tuple[str, Reason]] = Counter()
    # every other one first: one maker's frames stand beside one another
    ways = UNSEEN if which == "unseen" else WORSE
    given = reasons(Path(folder), [*names[::2], *names[1::2]], int(seed), float(strength), tuple(ways))
    for count, (name, kind, answer) in enumerate(given, 1):
        table[kind, answer.reason] += 1
        if answer.reason not in ways[kind][1]:
            print(f"{name}, {kind}: {answer.reason} ({answer.advice})", flush=True)
        if count == int(most):
            break
    for kind, (_, right) in ways.items():
        told_of = {reason: n for (done, reason), n in table.items() if done == kind}
        score = f"{sum(told_of.get(reason, 0) for reason in right)} of {sum(told_of.values())}"
        print(f"{kind:>12}: {score:>8}  {', '.join(f'{reason} {n}' for reason, n in told_of.items())}")
    right = sum(n for (kind, reason), n in table.items() if reason in ways[kind][1])
    print(f"{right} of {sum(table.values())} reasons are what was done")


if __name__ == "__main__":
    main(*sys.argv[1:])
