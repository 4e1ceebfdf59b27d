"""Two logs in one page: all trackers in one scene where both are of one drive, else side by side on one time line."""

import html
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from testbed.log import palette
from testbed.log.review_page.contents import contents

Contents = dict[str, Any]


def together(logs: Sequence[str | Path]) -> list[Contents]:
    """The contents of one or two logs: one where they are of the same drive, else one each.

    Raises OSError or ValueError, in one sentence, for a log that cannot be read.
    """
    first, *others = (contents(log) for log in logs)
    if others and same_drive(first, others[0]):
        return [merged(first, others[0])]
    return [first, *others]


def same_drive(a: Contents, b: Contents) -> bool:
    """Whether both logs have the same scans of the same ego and the same vehicles."""

    def places(data: Contents) -> list[Any]:
        return [[body[:1] + body[3:5] for body in frame] for frame in data["truth"]]

    return (a["time"], [e[1:3] for e in a["ego"]], places(a)) == (b["time"], [e[1:3] for e in b["ego"]], places(b))


def merged(a: Contents, b: Contents) -> Contents:
    """The first with the trackers of the second, whose shapes are numbered on; a name that both have tells the log."""
    a, b = deepcopy(a), deepcopy(b)
    both = {t["name"] for t in a["trackers"]} & {t["name"] for t in b["trackers"]}
    for data in (a, b):
        called = {name: f"{name} of {Path(data['run']['log']).stem}" for name in both}
        for row in (*data["trackers"], *data["moments"], *data["objects"]):
            key = "name" if "tracks" in row else "tracker"
            row[key] = called.get(row[key], row[key])
    start = len(a["shapes"])
    for i, tracker in enumerate(b["trackers"], len(a["trackers"])):
        tracker["color"] = palette.css(palette.tracker(i))
        tracker["tracks"] = [[[t[0], t[1] + start, *t[2:]] for t in frame] for frame in tracker["tracks"]]
    return a | {
        "run": a["run"] | {"log": f"{a['run']['log']} and {b['run']['log']}"},
        "trackers": a["trackers"] + b["trackers"],
        "shapes": a["shapes"] + b["shapes"],
        "names": b["names"] | a["names"],
        "moments": sorted(a["moments"] + b["moments"], key=lambda row: -row["severity"]),
        "objects": a["objects"] + b["objects"],
        "events": sorted(a["events"] + [e for e in b["events"] if e not in a["events"]], key=lambda e: e[0]),
    }


def side_by_side(pages: Sequence[str], titles: Sequence[str], template: str) -> str:
    """One page of two, whose times go together."""
    frames = "".join(
        f'<iframe title="{html.escape(title, quote=True)}" srcdoc="{html.escape(page, quote=True)}"></iframe>'
        for title, page in zip(titles, pages, strict=True)
    )
    title = html.escape(" and ".join(titles))
    return template.replace("{{title}}", title).replace("{{frames}}", frames)
