"""A report page as a reader meets it: its tags, links, texts and sections."""

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

VOID = {"meta", "img", "br", "link", "source", "hr", "input"}
ODD = re.compile(r"\b1 (?:trackers|scenarios|seeds|runs|changes|differences|pairs|planners|drives)\b")


class Page(HTMLParser):
    """Tags, links, texts and sections of a page; complains of tags that are not closed."""

    def __init__(self, path: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.path, self.open, self.links, self.ids, self.tags, self.texts = path, [], [], [], [], []
        self.section, self.by_section = "", {}
        self.feed(path.read_text())
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.tags.append(tag)
        self.links += [found[key] for key in ("href", "src") if key in found]
        self.ids += [found["id"]] if "id" in found else []
        if tag == "section":
            self.section = found.get("id", "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)
        self.by_section[self.section] = self.by_section.get(self.section, "") + data

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def check_links(page: Page) -> None:
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.ids
        else:
            assert "://" not in link
            assert (page.path.parent / unquote(link)).is_file(), link
    assert len(set(page.ids)) == len(page.ids)
