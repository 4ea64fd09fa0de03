"""The Laboratory: any set of methods on the open frame or on a simulated field."""

from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.ui.services import Services
from app.ui.widgets import label

ABOUT = "Every published method beside the default one, on the same stars."


class LaboratoryView(QWidget):
    """Methods side by side."""

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.setObjectName("page")
        self._services = services
        column = QVBoxLayout(self)
        column.addWidget(label(ABOUT, "muted", wrap=True))
        column.addStretch(1)
