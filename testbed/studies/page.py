"""What the pages of the documentation share: the notes below a line, which a new page keeps."""

from pathlib import Path

NOTES = "<!-- What follows is written by hand, and kept. -->"


def notes_of(path: Path) -> str:
    """What an older page has below the line NOTES."""
    return path.read_text().partition(NOTES)[2] if path.exists() else "\n"
