"""The style sheet of the window; ``$names`` are filled in by the theme.

Every kind of widget in use is dressed here, because Qt's own style mixes white into its edges,
which a red screen must not show.
"""

SHEET = """
* { font-size: ${point}pt; color: $text; selection-background-color: $accent;
    selection-color: $on_accent; outline: 0; }
QDialog, QMessageBox, QFileDialog { background: $window; }
QWidget#page, QScrollArea, QScrollArea > QWidget > QWidget, QStackedWidget, QSplitter
    { background: $window; border: 0; }
QLabel { background: transparent; }
QLabel[role="muted"] { color: $muted; }
QLabel[role="title"] { font-size: ${title}pt; font-weight: 600; }
QLabel[role="heading"] { font-size: ${large}pt; font-weight: 600; }
QLabel[role="value"] { font-size: ${large}pt; font-weight: 600; }
QLabel[role="value_old"] { font-size: ${large}pt; font-weight: 600; color: $muted; }
QLabel[role="good"] { color: $good; font-weight: 600; }
QLabel[role="bad"] { color: $bad; font-weight: 600; font-size: ${large}pt; }
QLabel[role="wrong"] { color: $bad; font-weight: 600; }
QLabel[role="old"] { color: $on_accent; background: $muted; border-radius: 4px;
    padding: 2px 8px; font-weight: 600; }
QFrame#card { background: $surface; border: 1px solid $line; border-radius: 8px; }
QFrame#rule { background: $line; border: 0; max-height: 1px; min-height: 1px; }

QMenuBar { background: $window; border-bottom: 1px solid $line; padding: 2px; }
QMenuBar::item { background: transparent; padding: 4px 10px; border-radius: 4px; }
QMenuBar::item:selected { background: $hover; }
QMenu { background: $surface; border: 1px solid $line; padding: 4px; }
QMenu::item { padding: 5px 28px 5px 26px; border-radius: 4px; background: transparent; }
QMenu::item:selected { background: $hover; }
QMenu::item:disabled { color: $faint; }
QMenu::separator { height: 1px; background: $line; margin: 4px 8px; }
QMenu::indicator { width: 14px; height: 14px; left: 6px; }
QMenu::indicator:checked { image: url($glyphs/check.png); }
QMenu::indicator:unchecked { image: none; }
QMenu::right-arrow { image: url($glyphs/right.png); width: 10px; height: 10px; }

QToolBar { background: $window; border: 0; border-bottom: 1px solid $line; padding: 3px 6px;
    spacing: 2px; }
QToolBar::separator { background: $line; width: 1px; margin: 6px 5px; }
QToolButton { background: transparent; border: 1px solid transparent; border-radius: 6px;
    padding: 3px 6px; font-size: ${small}pt; }
QToolButton:hover { background: $hover; }
QToolButton:checked { background: $raised; border-color: $faint; }
QToolButton:pressed { background: $line; }
QToolButton:focus { border-color: $accent; }
QToolButton:disabled { color: $faint; }
QToolButton#qt_toolbar_ext_button { background: $raised; padding: 0; border-radius: 4px;
    image: url($glyphs/right.png); qproperty-icon: none; }

QPushButton { background: $raised; border: 1px solid $line; border-radius: 6px;
    padding: 5px 12px; min-height: 1.2em; }
QPushButton:hover { background: $hover; }
QPushButton:pressed { background: $line; }
QPushButton:focus { border-color: $accent; }
QPushButton:disabled { color: $faint; background: $window; }
QPushButton[role="main"] { background: $accent; color: $on_accent; border-color: $accent;
    font-weight: 600; }
QPushButton[role="main"]:focus { border: 2px solid $text; padding: 4px 11px; }
QPushButton[role="sample"] { background: $surface; text-align: left; padding: 8px;
    min-height: 64px; }
QPushButton[role="sample"]:hover { background: $hover; }
QPushButton[role="sample"]:focus { border-color: $accent; }
QPushButton[role="link"] { background: transparent; border: 1px solid transparent;
    text-align: left; padding: 3px 6px; color: $accent; }
QPushButton[role="link"]:hover, QPushButton[role="link"]:focus { border-color: $accent; }
QPushButton[off="true"] { color: $faint; background: $window; }
QPushButton[role="main"][off="true"] { color: $faint; background: $window; border-color: $line; }
QPushButton[off="true"]:focus { border-color: $accent; }
QPushButton[role="stop"] { background: $stop; color: $on_stop; border: 2px solid $stop;
    font-size: ${large}pt; font-weight: 700; min-height: 2em; }
QPushButton[role="stop"]:focus { border-color: $text; }
QPushButton[role="stop"][off="true"] { background: $window; color: $faint; border-color: $line; }
QPushButton[role="small"] { padding: 2px 9px; font-size: ${small}pt; }

QLineEdit, QPlainTextEdit, QTextEdit, QSpinBox, QDoubleSpinBox, QComboBox
    { background: $surface; border: 1px solid $line; border-radius: 5px; padding: 4px 6px; }
QLineEdit { placeholder-text-color: $muted; }
QLineEdit:focus, QPlainTextEdit:focus, QTextEdit:focus, QComboBox:focus, QSpinBox:focus,
QDoubleSpinBox:focus { border-color: $accent; }
QLineEdit:disabled, QComboBox:disabled { color: $faint; }
QLineEdit[wrong="true"] { border: 2px solid $bad; }
QComboBox::drop-down { border: 0; width: 22px; }
QComboBox::down-arrow { image: url($glyphs/down.png); width: 10px; height: 10px; }
QComboBox { combobox-popup: 0; }
QComboBoxPrivateContainer { background: $surface; border: 1px solid $line; }
QComboBox QAbstractItemView { background: $surface; border: 1px solid $line;
    selection-background-color: $accent; selection-color: $on_accent; }
QAbstractSpinBox QLineEdit { background: transparent; border: 0; padding: 0 3px; }
QAbstractSpinBox::up-button, QAbstractSpinBox::down-button { border: 0; width: 16px; }
QAbstractSpinBox::up-arrow { image: url($glyphs/up.png); width: 9px; height: 9px; }
QAbstractSpinBox::down-arrow { image: url($glyphs/down.png); width: 9px; height: 9px; }

QCheckBox, QRadioButton { background: transparent; spacing: 7px; padding: 2px; }
QCheckBox::indicator, QRadioButton::indicator, QListView::indicator { width: 14px; height: 14px;
    border: 1px solid $muted; border-radius: 3px; background: $surface; }
QRadioButton::indicator { border-radius: 8px; }
QCheckBox::indicator:checked, QRadioButton::indicator:checked, QListView::indicator:checked
    { background: $accent; border-color: $accent; image: url($glyphs/tick.png); }
QCheckBox:focus, QRadioButton:focus { color: $accent; }
QCheckBox:disabled, QCheckBox[off="true"] { color: $faint; }

QSlider { background: transparent; min-height: 20px; }
QSlider::groove:horizontal { height: 4px; background: $line; border-radius: 2px; }
QSlider::sub-page:horizontal { background: $accent; border-radius: 2px; }
QSlider::handle:horizontal { background: $text; width: 12px; margin: -5px 0; border-radius: 6px; }
QSlider::handle:horizontal:focus { background: $accent; border: 2px solid $text; width: 10px; }
QSlider::handle:horizontal:disabled, QSlider::sub-page:horizontal:disabled { background: $line; }

QTabWidget::pane { border: 0; border-top: 1px solid $line; background: $window; top: -1px; }
QTabBar { background: transparent; qproperty-drawBase: 0; }
QTabBar::tab { background: transparent; border: 0; border-bottom: 2px solid transparent;
    padding: 6px 12px; color: $muted; }
QTabBar::tab:selected { color: $text; border-bottom-color: $accent; }
QTabBar::tab:hover { color: $text; background: $hover; }
QTabBar::tab:focus { color: $accent; }

QDockWidget { titlebar-close-icon: url($glyphs/close.png);
    titlebar-normal-icon: url($glyphs/float.png); }
QDockWidget::title { background: $raised; padding: 5px 8px; text-align: left; }
QDockWidget::close-button, QDockWidget::float-button { background: transparent; border: 0; }
QDockWidget::close-button:hover, QDockWidget::float-button:hover { background: $hover; }

QTableView, QListView, QTreeView { background: $surface; alternate-background-color: $window;
    border: 1px solid $line; gridline-color: $line; }
QTableView:focus, QListView:focus, QTreeView:focus { border-color: $accent; }
QTableView::item { padding: 1px 4px; }
QListView::item { padding: 1px 0; }
QTableView::item:selected, QListView::item:selected, QTreeView::item:selected
    { background: $accent; color: $on_accent; }
QGraphicsView { border: 1px solid transparent; }
QGraphicsView:focus { border-color: $accent; }
QGraphicsView#histogram { border: 1px solid $line; border-radius: 4px; }
QHeaderView { background: $raised; border: 0; }
QHeaderView::section { background: $raised; border: 0; border-right: 1px solid $line;
    border-bottom: 1px solid $line; padding: 4px 6px; }
QHeaderView::section:hover { background: $hover; }
QHeaderView::up-arrow { image: url($glyphs/up.png); width: 9px; height: 9px; }
QHeaderView::down-arrow { image: url($glyphs/down.png); width: 9px; height: 9px; }
QTableCornerButton::section { background: $raised; border: 0; }

QScrollBar { background: $window; border: 0; margin: 0; }
QScrollBar:vertical { width: 12px; }
QScrollBar:horizontal { height: 12px; }
QScrollBar::handle { background: $line; border-radius: 4px; margin: 2px; }
QScrollBar::handle:vertical { min-height: 28px; }
QScrollBar::handle:horizontal { min-width: 28px; }
QScrollBar::handle:hover { background: $muted; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; border: 0; background: none; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }
QAbstractScrollArea::corner { background: $window; border: 0; }

QProgressBar { background: $surface; border: 1px solid $line; border-radius: 5px;
    text-align: center; min-height: 14px; max-height: 14px; font-size: ${small}pt; }
QProgressBar::chunk { background: $hover; border-radius: 4px; }
QStatusBar { background: $window; border-top: 1px solid $line; }
QStatusBar::item { border: 0; }
QStatusBar QLabel[role="muted"] { padding-left: 10px; }
QSplitter::handle { background: $line; }
QSplitter::handle:horizontal { width: 1px; }
QSplitter::handle:vertical { height: 1px; }
QGroupBox { border: 1px solid $line; border-radius: 6px; margin-top: 0.9em; padding-top: 6px; }
QGroupBox::title { subcontrol-origin: margin; left: 8px; padding: 0 4px; color: $muted; }
QToolTip { background: $raised; color: $text; border: 1px solid $line; padding: 4px; }
"""
