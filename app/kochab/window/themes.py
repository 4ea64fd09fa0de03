"""Themes: colours, fonts, style sheet and icons; night uses red light alone."""

import atexit
import shutil
import tempfile
from dataclasses import asdict, field, fields
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

from PySide6.QtCore import QByteArray, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QIcon, QPainter, QPalette, QPixmap
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QApplication

from kochab.core.values import frozen
from kochab.folders import data_folder
from kochab.text.translation import tr_noop


def _shades(dark: str, light: str, night: str) -> Any:
    """A colour's three values, by the names of their themes."""
    return field(metadata={"dark": dark, "light": light, "night": night})


@frozen
class Colours:
    """One theme, as ``#rrggbb``. Night holds red light alone: its green and blue are exactly 0."""

    window: str = _shades("#1a1d23", "#eef0f3", "#000000")
    surface: str = _shades("#22262e", "#ffffff", "#0c0000")
    raised: str = _shades("#2d323c", "#e3e7ec", "#240000")
    hover: str = _shades("#383f4b", "#d5dbe3", "#3a0000")
    line: str = _shades("#3d4450", "#b9c1cc", "#5c0000")
    faint: str = _shades("#6b7686", "#8d97a5", "#860000")  # what cannot be used now
    text: str = _shades("#e8ebf0", "#1a1f27", "#ff0000")
    muted: str = _shades("#a3adbd", "#515b69", "#dc0000")
    accent: str = _shades("#56b4f9", "#0a63b0", "#ff0000")
    on_accent: str = _shades("#06141f", "#ffffff", "#000000")
    good: str = _shades("#5fd39a", "#17703f", "#ff0000")
    bad: str = _shades("#ff8a7a", "#b3261e", "#ff0000")
    sky: str = _shades("#0c0e11", "#0c0e11", "#000000")  # behind the frame
    detected: str = _shades("#f0b440", "#f0b440", "#c00000")
    identified: str = _shades("#62d6ff", "#62d6ff", "#ff0000")
    selected: str = _shades("#ffffff", "#ffffff", "#ff0000")
    star: str = _shades("#dce8f6", "#dce8f6", "#f00000")  # names of stars, and what else the sky layer draws
    galaxy: str = _shades("#c3b1ff", "#c3b1ff", "#e80000")
    cluster: str = _shades("#ffd873", "#ffd873", "#e80000")
    nebula: str = _shades("#ff9db4", "#ff9db4", "#e80000")
    dark: str = _shades("#b9c4d0", "#b9c4d0", "#c80000")
    figure: str = _shades("#9fb4d6", "#9fb4d6", "#900000")
    ecliptic: str = _shades("#f2c14e", "#f2c14e", "#a00000")
    grid: str = _shades("#86a8cc", "#86a8cc", "#960000")
    grid_text: str = _shades("#b4cbe4", "#b4cbe4", "#e00000")
    horizon: str = _shades("#84c9a2", "#84c9a2", "#780000")  # the Alt/Az grid
    horizon_text: str = _shades("#b2dfc4", "#b2dfc4", "#c80000")
    centre: str = _shades("#ff7ab0", "#ff7ab0", "#ff0000")
    mount: str = _shades("#ffd15c", "#ffd15c", "#ff0000")  # where the mount says that it points, on the chart
    solved: str = _shades("#63dc9f", "#63dc9f", "#ff0000")  # where plate solving found that it points
    way: str = _shades("#6db9ff", "#6db9ff", "#d00000")  # of a slew
    ground: str = _shades("#0b1712", "#0b1712", "#1a0000")  # below the horizon
    halo: str = _shades("#0c0e11", "#0c0e11", "#000000")  # behind labels on the frame
    stop: str = _shades("#c62828", "#c62828", "#ff0000")  # the one button that stops a mount
    on_stop: str = _shades("#ffffff", "#ffffff", "#000000")


THEME_TITLES = {"dark": tr_noop("&Dark"), "light": tr_noop("&Light"), "night": tr_noop("&Night (red light only)")}
THEMES = {theme: Colours(**{f.name: f.metadata[theme] for f in fields(Colours)}) for theme in THEME_TITLES}
HUES = {
    tr_noop("White"): "#f2f5f9",
    tr_noop("Blue"): "#6fb1ff",
    tr_noop("Turquoise"): "#5fd8d2",
    tr_noop("Green"): "#7fd98a",
    tr_noop("Yellow"): "#ffd75e",
    tr_noop("Orange"): "#ffa64d",
    tr_noop("Red"): "#ff6f66",
    tr_noop("Pink"): "#ff9ad5",
    tr_noop("Violet"): "#b99aff",
}
"""What a layer of the sky may be drawn in instead of its own colours."""
_CURRENT = "kochab_theme"  # the property of the application that names its theme


def theme_colours() -> Colours:
    """The colours of the application's theme, the dark one's before it has any."""
    app = QApplication.instance()
    return THEMES[(app.property(_CURRENT) if app is not None else None) or "dark"]


@cache
def glyphs(colour: str) -> QSvgRenderer:
    """The drawings of ``resources/glyphs.svg`` in a colour."""
    drawn = (data_folder("resources") / "glyphs.svg").read_text(encoding="utf-8").replace("currentColor", colour)
    return QSvgRenderer(QByteArray(drawn.encode()))


def draw_glyph(painter: QPainter, name: str, colour: str, box: QRectF) -> None:
    """Draw one glyph in a square box.

    Parameters
    ----------
    painter : QPainter
        Draws it.
    name : str
        Its element in ``glyphs.svg``.
    colour : str
        Of its lines.
    box : QRectF
        Square that it fills.
    """
    painter.save()
    painter.translate(box.topLeft())
    painter.scale(box.width() / 24.0, box.height() / 24.0)
    drawings = glyphs(colour)
    drawings.render(painter, name, drawings.boundsOnElement(name))
    painter.restore()


def pixmap(name: str, colour: str, size: int, ratio: float = 1.0) -> QPixmap:
    """One glyph as a picture.

    Parameters
    ----------
    name : str
        Its element in ``glyphs.svg``.
    colour : str
        Of its lines.
    size : int
        Of the square, logical px.
    ratio : float
        Pixels of the screen a logical px.
    """
    picture = QPixmap(round(size * ratio), round(size * ratio))
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    draw_glyph(painter, name, colour, QRectF(picture.rect()))
    painter.end()
    # After the painting, which counts in pixels of the picture.
    picture.setDevicePixelRatio(ratio)
    return picture


def translucent(colour: str, alpha: int) -> QColor:
    """A colour, ``alpha`` 0..255 of it opaque."""
    made = QColor(colour)
    made.setAlpha(alpha)
    return made


@cache
def icon(name: str, colour: str, faint: str) -> QIcon:
    """A toolbar icon with its disabled form, drawn once for every theme that is used."""
    made = QIcon()
    for ratio in (1.0, 2.0):
        made.addPixmap(pixmap(name, colour, 22, ratio), QIcon.Mode.Normal)
        made.addPixmap(pixmap(name, faint, 22, ratio), QIcon.Mode.Disabled)
    return made


@cache
def write_glyphs(theme: str, text: str, on_accent: str) -> str:
    """Files the style sheet refers to; returns their folder, with forward slashes."""
    folder = Path(tempfile.mkdtemp(prefix=f"kochab-glyphs-{theme}-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name in ("check", "tick", "right", "down", "up", "close", "float"):
        colour = on_accent if name == "tick" else text
        pixmap(name, colour, 16).save(str(folder / f"{name}.png"))
        pixmap(name, colour, 16, 2.0).save(str(folder / f"{name}@2x.png"))
    return folder.as_posix()


TEXT_SIZES = {"small": 0.9, "normal": 1.0, "large": 1.25, "huge": 1.6}
TEXT_SIZE_TITLES = dict(
    zip(TEXT_SIZES, (tr_noop("&Small"), tr_noop("&Normal"), tr_noop("&Large"), tr_noop("&Huge")), strict=True)
)
BASE_POINT = 10.0
STYLE_SIZES = {"point": 1.0, "small": 0.9, "large": 1.45, "title": 2.2}  # the style sheet's, in points of the text


def apply_theme(app: QApplication, name: str, text_size: str = "normal") -> str:
    """Give ``app`` a theme, and return the style sheet for the parts of its window.

    Unknown names fall back to dark and normal. What paints itself reads :func:`theme_colours`: Qt
    has every widget painted again when the palette changes.
    """
    name = name if name in THEMES else "dark"
    colours = THEMES[name]
    app.setProperty(_CURRENT, name)
    point = BASE_POINT * TEXT_SIZES.get(text_size, 1.0)
    if not app.property("kochab_style"):  # once: it costs as much as everything else here
        app.setStyle("Fusion")
        app.setProperty("kochab_style", True)
    font = QFont(app.font())
    font.setPointSizeF(point)
    # Coloured fringes around letters would put green and blue on a red screen.
    font.setStyleStrategy(QFont.StyleStrategy.NoSubpixelAntialias)
    app.setFont(font)
    app.setPalette(_palette(colours))
    sizes = {role: f"{point * times:.1f}" for role, times in STYLE_SIZES.items()}
    glyphs = write_glyphs(name, colours.text, colours.on_accent)
    sheet = Template((data_folder("resources") / "style.qss").read_text(encoding="utf-8"))
    return sheet.substitute(asdict(colours), **sizes, glyphs=glyphs)


# Names of Qt's palette roles, by the colour they have in every theme.
ROLES = {
    "window": "Window Shadow",
    "surface": "Base",
    "raised": "AlternateBase Button ToolTipBase Midlight",
    "hover": "Light",
    "line": "Mid Dark",
    "text": "WindowText Text ButtonText BrightText ToolTipText",
    "muted": "PlaceholderText",
    "accent": "Highlight Link LinkVisited Accent",
    "on_accent": "HighlightedText",
}


def _palette(colours: Colours) -> QPalette:
    palette = QPalette()
    for name, roles in ROLES.items():
        for role in roles.split():
            palette.setColor(QPalette.ColorRole[role], QColor(getattr(colours, name)))
    for role in ("WindowText", "Text", "ButtonText"):
        palette.setColor(QPalette.ColorGroup.Disabled, QPalette.ColorRole[role], QColor(colours.faint))
    return palette
