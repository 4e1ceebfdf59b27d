"""Damaged copies of files: bytes that flip or end early, values of another type or shape."""

import io
import json
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

Damage = Callable[[bytes, np.random.Generator], bytes]

NESTED = 100_000  # levels


def flipped(content: bytes, rng: np.random.Generator) -> bytes:
    """One bit."""
    found = np.frombuffer(content, np.uint8).copy()
    found[rng.integers(len(found))] ^= 1 << rng.integers(8)
    return found.tobytes()


def scattered(content: bytes, rng: np.random.Generator) -> bytes:
    """Twenty bytes anywhere."""
    found = np.frombuffer(content, np.uint8).copy()
    found[rng.integers(len(found), size=20)] = rng.integers(256, size=20)
    return found.tobytes()


def cut(content: bytes, rng: np.random.Generator) -> bytes:
    """The end is missing."""
    return content[: rng.integers(len(content))]


def erased(content: bytes, rng: np.random.Generator) -> bytes:
    """Two hundred bytes are zero, as after a crash of the machine."""
    at = int(rng.integers(len(content)))
    return (content[:at] + bytes(200) + content[at + 200 :])[: len(content)]


def absurd(content: bytes, rng: np.random.Generator) -> bytes:
    """Eight bytes at the beginning or at the end, where lengths are, say the largest number."""
    at = int(rng.choice([rng.integers(200), len(content) - 8 - rng.integers(200)]))
    return content[:at] + b"\xff" * 8 + content[at + 8 :]


def doubled(content: bytes, rng: np.random.Generator) -> bytes:
    """The content twice."""
    return content + content


BYTES: tuple[Damage, ...] = (flipped, scattered, cut, erased, absurd, doubled)

CELLS = ("", " ", "x", "nan", "inf", "-1", "1e308", "1e400", "9" * 400, "1,5", '"', "\x00", "名", "a" * 3000, "-", "١")


def other_cell(content: bytes, rng: np.random.Generator) -> bytes:
    """A CSV file with something else in one place, its header not left out."""
    lines = [line.split(b",") for line in content.split(b"\n")]
    row = lines[rng.choice([0, rng.integers(len(lines))])]
    row[rng.integers(len(row))] = CELLS[rng.integers(len(CELLS))].encode()
    return b"\n".join(b",".join(line) for line in lines)


# -- values -----------------------------------------------------------------------------------------------------------

JSON_VALUES = (
    None, True, -1, 0, 1e308, -1e308, float("nan"), float("inf"), 10**30, "", "x", "9" * 30, [], {}, [[]], [None],
    {"x": 1}, [1, 2, 3], "\ud800",
)  # fmt: skip


def other_value(content: bytes, rng: np.random.Generator) -> bytes:
    """A JSON file with another value, or none, in one place."""
    found = json.loads(content)
    place = found
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[rng.integers(len(keys))]
        if not (isinstance(place[key], dict | list) and place[key]) or rng.random() < 0.3:
            break
        place = place[key]
    if rng.random() < 0.1:
        del place[key]
    else:
        place[key] = JSON_VALUES[rng.integers(len(JSON_VALUES))]
    return json.dumps(found).encode()


def other_document(content: bytes, rng: np.random.Generator) -> bytes:
    """Something else that JSON can be, or nearly."""
    opening = [b"[", b'{"a":', b'{"layout":1,"trackers":', b'{"format":']
    documents = [
        *(o * NESTED for o in opening),
        b"[" * NESTED + b"]" * NESTED,
        b"1" * 10_000,
        b"\xef\xbb\xbf" + content,
        content.decode().encode("utf-16"),
        b"\x00" * 100,
        b"\xff\xfe\xfd",
        *(json.dumps(value).encode() for value in JSON_VALUES),
    ]
    return documents[rng.integers(len(documents))]


def other_array(content: bytes, rng: np.random.Generator) -> bytes:
    """An archive of arrays, one of which has another shape, type or value, or is missing."""
    arrays = _arrays(content)
    name = list(arrays)[rng.integers(len(arrays))]
    variants = list(_variants(arrays[name], rng))
    choice = rng.integers(len(variants) + 1)
    if choice == len(variants):
        del arrays[name]
    else:
        arrays[name] = variants[choice]
    return _archive(arrays)


def _variants(a: np.ndarray, rng: np.random.Generator) -> Iterator[np.ndarray]:
    yield a.ravel()[0] if a.size else np.array(0.0)  # 0-d
    yield np.array(None, object)
    yield a[:0]
    yield a[:-1]
    yield np.concatenate([a, a])
    yield a[None]
    yield a[..., None]
    yield a.T
    yield a.astype("U32")
    yield np.full(a.shape, b"\xff")
    yield np.zeros(a.shape, [("x", "f8")])
    yield np.zeros(a.shape, "M8[s]")
    if a.dtype.kind in "fiu":
        for value in (np.nan, np.inf, -1, 0, 1e300, -1e300, 2.0**62):
            yield np.full(a.shape, value)
            some = a.astype(float)
            some.flat[rng.integers(max(a.size, 1))] = value
            yield some
        yield a.astype(complex)
        yield a.astype(bool)
        yield a.astype("f2")
        yield a.astype(">f4")
        yield -a
        yield np.sort(a, None)[::-1].reshape(a.shape).astype(np.int64)


def other_header(content: bytes, rng: np.random.Generator) -> bytes:
    """An archive one of whose arrays claims another shape or type than it has."""
    arrays = _arrays(content)
    name = list(arrays)[rng.integers(len(arrays))]
    headers = [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000000000000,), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<U1000000000', 'fortran_order': False, 'shape': (3,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 1000000000000), }",
        "{'descr': 'nothing', 'fortran_order': 3}",
        "(" * 300 + ")" * 300,
        "",
    ]
    header = headers[rng.integers(len(headers))].encode() + b"\n"
    return _archive(arrays, {name: b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(64)})


def claim(content: bytes, rng: np.random.Generator) -> bytes:
    """An archive that says that its first array unpacks to four gigabytes."""
    at = content.index(b"PK\x01\x02") + 24  # uncompressed size in the first entry of the central directory
    return content[:at] + (2**32 - 16).to_bytes(4, "little") + content[at + 4 :]


def with_array(content: bytes, name: str, array: np.ndarray) -> bytes:
    """An archive with another array of that name."""
    return _archive({**_arrays(content), name: array})


def _arrays(content: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(content)) as archive:
        return {name: archive[name] for name in archive.files}


def _archive(arrays: dict[str, np.ndarray], raw: dict[str, bytes] | None = None) -> bytes:
    found = io.BytesIO()
    with zipfile.ZipFile(found, "w") as archive:
        for name, array in arrays.items():
            part = io.BytesIO()
            np.save(part, array)
            archive.writestr(f"{name}.npy", (raw or {}).get(name, part.getvalue()))
    return found.getvalue()


DAMAGES: dict[str, tuple[Damage, ...]] = {
    ".rrd": BYTES,
    ".parquet": BYTES,
    ".csv": (*BYTES, other_cell, other_cell, other_cell, other_cell),
    ".npz": (*BYTES, other_array, other_array, other_array, other_header, claim),
    ".json": (*BYTES, other_value, other_value, other_value, other_document, other_document),
}


def damaged(path: Path, seed: int) -> bytes:
    """A damaged copy of a file; the same seed gives the same."""
    rng = np.random.default_rng([seed, *path.name.encode()])
    kinds = DAMAGES[path.suffix]
    return kinds[rng.integers(len(kinds))](path.read_bytes(), rng)
