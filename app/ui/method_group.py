"""How a frame is solved: detector, method with its options, and attitude estimator."""

from typing import Any

from PySide6.QtWidgets import QComboBox, QFormLayout, QGroupBox, QVBoxLayout

from app.attitude import ESTIMATORS
from app.core.errors import UsageError
from app.identify.options import method_options, paper_of
from app.ui.options_form import OptionsForm
from app.ui.widgets import label

FITTED = "fitted with the camera"


class MethodGroup(QGroupBox):
    """The choices of ``--method``, ``--detector`` and ``--attitude``."""

    def __init__(self, methods: list[str], detectors: list[str]) -> None:
        super().__init__("Method")
        self.method = _box("Method", methods)
        self.detector = _box("Detector", detectors)
        self.attitude = _box("Attitude", [FITTED, *ESTIMATORS])
        self.method.currentTextChanged.connect(self._show_method)
        self.paper = label("", "muted", wrap=True)
        self.options = OptionsForm()
        form = QFormLayout()
        form.setHorizontalSpacing(12)
        form.setVerticalSpacing(8)
        form.addRow("&Method", self.method)
        form.addRow("Dete&ctor", self.detector)
        form.addRow("&Attitude", self.attitude)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(self.paper)
        column.addWidget(self.options)
        self.paper.hide()
        self.options.hide()

    def choices(self) -> dict[str, Any]:
        """For :class:`app.solve.options.SolveOptions`; UsageError when an option is not allowed."""
        try:
            options = self.options.values()
        except UsageError as error:
            raise UsageError(f"Method {self.method.currentText()}: {error}") from error
        fitted = self.attitude.currentIndex() == 0
        return {
            "method": self.method.currentText(),
            "method_options": options,
            "detector": self.detector.currentText(),
            "attitude": None if fitted else self.attitude.currentText(),
        }

    def reset(self) -> None:
        """The default of everything."""
        for box in (self.method, self.detector, self.attitude):
            box.setCurrentIndex(0)

    def _show_method(self, name: str) -> None:
        options = method_options(name)
        self.options.show_options(options)
        self.options.setVisible(bool(options))
        paper = paper_of(name)
        self.paper.setText(paper)
        self.paper.setVisible(bool(paper))


def _box(name: str, choices: list[str]) -> QComboBox:
    box = QComboBox()
    box.addItems(choices)
    box.setAccessibleName(name)
    box.setMinimumContentsLength(8)
    return box
