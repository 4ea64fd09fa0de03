"""One theme: palette and font for the application, a style sheet for the window's parts."""

from string import Template

from PySide6.QtGui import QColor, QFont, QPalette
from PySide6.QtWidgets import QApplication

from app.ui.glyphs import write_glyphs
from app.ui.palette import THEMES, Colours
from app.ui.style_sheet import SHEET

TEXT_SIZES = {"small": 0.9, "normal": 1.0, "large": 1.25, "huge": 1.6}
BASE_POINT = 10.0


def apply_theme(app: QApplication, name: str, text_size: str = "normal") -> tuple[Colours, str]:
    """Dress ``app``; unknown names fall back to dark and normal.

    Returns the colours, and the style sheet for :class:`app.ui.wardrobe.Wardrobe` to put on.
    """
    colours = THEMES.get(name, THEMES["dark"])
    point = BASE_POINT * TEXT_SIZES.get(text_size, 1.0)
    if not app.property("dressed"):  # once: it costs as much as everything else here
        app.setStyle("Fusion")
        app.setProperty("dressed", True)
    font = QFont(app.font())
    font.setPointSizeF(point)
    # Coloured fringes around letters would put green and blue on a red screen.
    font.setStyleStrategy(QFont.StyleStrategy.NoSubpixelAntialias)
    app.setFont(font)
    app.setPalette(_palette(colours))
    names = {**colours.as_dict(), "point": f"{point:.1f}", "small": f"{point * 0.9:.1f}",
             "large": f"{point * 1.45:.1f}", "title": f"{point * 2.2:.1f}"}  # fmt: skip
    names["glyphs"] = write_glyphs(name, colours.text, colours.muted, colours.on_accent)
    return colours, Template(SHEET).substitute(names)


def _palette(c: Colours) -> QPalette:
    palette = QPalette()
    role = QPalette.ColorRole
    for target, colour in {
        role.Window: c.window, role.Base: c.surface, role.AlternateBase: c.raised,
        role.Button: c.raised, role.WindowText: c.text, role.Text: c.text,
        role.ButtonText: c.text, role.BrightText: c.text, role.ToolTipBase: c.raised,
        role.ToolTipText: c.text, role.PlaceholderText: c.muted, role.Highlight: c.accent,
        role.HighlightedText: c.on_accent, role.Link: c.accent, role.LinkVisited: c.accent,
        role.Accent: c.accent, role.Light: c.hover, role.Midlight: c.raised, role.Mid: c.line,
        role.Dark: c.line, role.Shadow: c.window,
    }.items():  # fmt: skip
        palette.setColor(target, QColor(colour))
    for target in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, target, QColor(c.faint))
    return palette
