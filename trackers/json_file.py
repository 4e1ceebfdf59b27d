"""JSON files that users bring: read as a whole, or refused in one sentence, whatever they hold."""

import json
from pathlib import Path
from typing import Any

LARGEST = 100_000_000  # [bytes]


def read_json(path: Path) -> Any:
    """The value in a JSON file.

    Raises OSError for one that is not there or cannot be read, ValueError for one that holds no JSON or is too large.
    """
    if not path.exists():
        raise FileNotFoundError(f"there is no file {path}")
    if not path.is_file():
        raise OSError(f"{path} is not a file; name a JSON file")
    if (size := path.stat().st_size) > LARGEST:
        raise ValueError(f"{path} is too large for JSON of ours, {size} bytes; name another file")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise OSError(f"cannot read {path}: {error.strerror}; name another file") from None
    except RecursionError:
        raise ValueError(f"{path} is damaged or no JSON of ours: it is nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path} is damaged or no JSON ({error})") from None
