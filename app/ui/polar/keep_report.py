"""The report as files: the web page, and the same as a PDF through Qt's printing."""

import re
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QMarginsF, QSizeF, QUrl
from PySide6.QtGui import QImage, QPageLayout, QPageSize, QPainter, QPdfWriter, QTextDocument
from PySide6.QtSvg import QSvgRenderer

from app.core.errors import KochabError
from app.core.progress import Progress, Task
from app.frames.whole_file import write_whole
from app.polar.history import History
from app.polar.report import STYLE, report_html, write_report

DPI, MARGIN_MM, FINE = 150, 15.0, 2.0
SVG = re.compile(r"<svg.*?</svg>", re.DOTALL)
CLEAR = re.compile(r"fill:(#[0-9a-fA-F]{6})([0-9a-fA-F]{2})")  # which Qt's reader takes for black
RULE = re.compile(r"([^{}]+)\{([^{}]*)\}")


def writing(path: Path, history: History) -> Task[Path]:
    """The web page and its JSON, or a PDF when the name ends so; in a job, it takes 0.1 s.

    Raises
    ------
    KochabError
        The file cannot be written.

    """
    yield Progress("report", None, path.name)
    if path.suffix.lower() != ".pdf":
        write_report(path, history)
        return path
    try:
        write_pdf_report(path, history)
    except OSError as error:
        why = error.strerror or error
        raise KochabError(f"The report {path} cannot be written: {why}.") from None
    return path


def write_pdf_report(path: Path, history: History) -> None:
    """The same page on paper, A4.

    Raises
    ------
    OSError
        The file cannot be written.

    """
    paper = QBuffer()  # the writer is silent about a place that cannot be written
    paper.open(QIODevice.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(paper)
    writer.setResolution(DPI)
    margins = QMarginsF(MARGIN_MM, MARGIN_MM, MARGIN_MM, MARGIN_MM)
    page = QPageSize(QPageSize.PageSizeId.A4)
    layout = QPageLayout(page, QPageLayout.Orientation.Portrait, margins)
    layout.setUnits(QPageLayout.Unit.Millimeter)
    layout.setMargins(margins)
    writer.setPageLayout(layout)
    writer.setTitle("Polar alignment")
    document = page_document(history)
    document.documentLayout().setPaintDevice(writer)
    document.setPageSize(QSizeF(writer.width(), writer.height()))
    document.print_(writer)
    write_whole(path, bytes(paper.data().data()))


def page_document(history: History) -> QTextDocument:
    """The report with its drawings as pictures, which is what a text document can hold."""
    document = QTextDocument()
    html = report_html(history)
    for number, drawing in enumerate(SVG.findall(html)):
        name = f"plot{number}.png"
        picture = _drawn(drawing)
        document.addResource(
            QTextDocument.ResourceType.ImageResource.value, QUrl(name), picture
        )  # fmt: skip
        wide = round(picture.width() / FINE * DPI / 96.0)
        html = html.replace(drawing, f'<p><img src="{name}" width="{wide}"></p>')
    # Of a table's style a text document takes little.
    html = html.replace("text-align:right;", "").replace("</td>", "&nbsp;&nbsp;</td>")
    document.setHtml(html)
    return document


def _opaque(found: re.Match[str]) -> str:
    return f"fill:{found[1]};fill-opacity:{int(found[2], 16) / 255.0:.2f}"


def _drawn(drawing: str) -> QImage:
    """A drawing with the page's own style inside it."""
    rules = "".join(
        f"{name.strip().split()[-1]}{{{CLEAR.sub(_opaque, body)}}}"
        for name, body in RULE.findall(STYLE)
        if name.strip().startswith((".", "svg text"))
    )
    styled = drawing.replace(">", f"><style>{rules}</style>", 1).replace(
        "<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1
    )
    renderer = QSvgRenderer(styled.encode("utf-8"))
    image = QImage(renderer.defaultSize() * FINE, QImage.Format.Format_RGB32)
    image.fill(0xFFFFFF)
    painter = QPainter(image)
    renderer.render(painter)
    painter.end()
    return image
