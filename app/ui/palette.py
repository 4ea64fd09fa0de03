"""The colours of each theme; night holds red light alone (green and blue are exactly 0)."""

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class Colours:
    """One theme, as ``#rrggbb``."""

    window: str
    surface: str
    raised: str
    hover: str
    line: str
    faint: str  # what cannot be used now
    text: str
    muted: str
    accent: str
    on_accent: str
    good: str
    bad: str
    sky: str  # behind the frame
    detected: str
    identified: str
    selected: str
    grid: str
    grid_text: str
    centre: str
    halo: str  # behind labels on the frame
    stop: str  # the one button that stops a mount
    on_stop: str

    def as_dict(self) -> dict[str, str]:
        """Name to colour, for the style sheet."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


THEMES: dict[str, Colours] = {
    "dark": Colours(
        window="#1a1d23", surface="#22262e", raised="#2d323c", hover="#383f4b", line="#3d4450",
        faint="#6b7686", text="#e8ebf0", muted="#a3adbd", accent="#56b4f9", on_accent="#06141f",
        good="#5fd39a", bad="#ff8a7a", sky="#0c0e11", detected="#f0b440", identified="#62d6ff",
        selected="#ffffff", grid="#86a8cc", grid_text="#b4cbe4", centre="#ff7ab0", halo="#0c0e11",
        stop="#c62828", on_stop="#ffffff",
    ),
    "light": Colours(
        window="#eef0f3", surface="#ffffff", raised="#e3e7ec", hover="#d5dbe3", line="#b9c1cc",
        faint="#8d97a5", text="#1a1f27", muted="#515b69", accent="#0a63b0", on_accent="#ffffff",
        good="#17703f", bad="#b3261e", sky="#0c0e11", detected="#f0b440", identified="#62d6ff",
        selected="#ffffff", grid="#86a8cc", grid_text="#b4cbe4", centre="#ff7ab0", halo="#0c0e11",
        stop="#c62828", on_stop="#ffffff",
    ),
    "night": Colours(
        window="#000000", surface="#0c0000", raised="#240000", hover="#3a0000", line="#5c0000",
        faint="#860000", text="#ff0000", muted="#dc0000", accent="#ff0000", on_accent="#000000",
        good="#ff0000", bad="#ff0000", sky="#000000", detected="#c00000", identified="#ff0000",
        selected="#ff0000", grid="#960000", grid_text="#e00000", centre="#ff0000", halo="#000000",
        stop="#ff0000", on_stop="#000000",
    ),
}  # fmt: skip
THEME_TITLES = {"dark": "&Dark", "light": "&Light", "night": "&Night (red light only)"}
