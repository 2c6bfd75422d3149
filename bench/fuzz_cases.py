"""The cases of fuzz_inputs.py: what is damaged, and how. Everything follows from the generator that a case is given."""

from __future__ import annotations

import functools
import json
import os
import struct
import sys
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "test" / "helpers"))

NASTY = (
    *("", " ", "~", "null", "true", "no", "0", "-1", "1e3", "1e999", "-1e-999", ".nan", ".inf", "-.inf", "0x_", "0b2"),
    *("9" * 30, "9" * 5000, "0x" + "f" * 5000, "2001-99-99", "2001-01-01", "1:99:99", "!!bool x", "!!timestamp q"),
    *("!!int ''", "!!binary x", "!!python/name:os.system", "!!set {a}", "!!omap [a: 1]", "*x", "&a [*a]", "&a {b: *a}"),
    *("[", "{", "]", "}", "[[[[", "[" * 3000, "{a: " * 3000, "'", '"', "|", ">", "%", "@", "`", "? a", "<<: x", ": :"),
    *("{a: 1, a: 2}", "[1, 2, 3]", "[[1], [2]]", "[a, 1, null]", "{}", "[]", "{1: 2}", "{[1]: 2}", "x" * 40_000),
    *(
        "\x00",
        "\x1b[31m",
        "\ufeff",
        "\u202e",
        "\ud7ff",
        "é",
        "\t",
        "\r",
        "-",
        "--",
        "---",
        "...",
        "#",
        "../../etc/passwd",
    ),
    *(
        "/dev/zero",
        "/dev/stdin",
        "/proc/self/mem",
        "nan",
        "inf",
        "None",
        "True",
        "'1'",
        "1_000",
        "٣",
        "1.5.2",
        "+",
        "=",
        "a=b",
    ),
)
KEYS = ("seed", "name", "followers", "world", "leader", "predictor", "drive", "fine_tuner", "block_detector")
RECEIVERS = ("info", "analyze", "recover", "replay", "predict")


@dataclass
class Case:
    """A call: kind, and the words behind `formation`."""

    kind: str
    arguments: list[str]


def make_case(rng: np.random.Generator, number: int, folder: Path) -> Case:
    """Make a case of a number in a folder of its own."""
    names = list(KINDS)
    weights = np.array([weight for _, weight in KINDS.values()], float)
    kind = names[rng.choice(len(names), p=weights / weights.sum())]
    make, _ = KINDS[kind]
    return Case(kind, [str(word) for word in make(rng, folder)])


def pick(rng: np.random.Generator, items: Sequence[Any]) -> Any:
    """Choose one of them."""
    return items[int(rng.integers(len(items)))]


# What is done to texts and bytes.


def damaged_text(rng: np.random.Generator, text: str) -> str:
    """Change a text in one to four places."""
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(len(text) + 1))
        length = int(rng.integers(1, 40))
        kind = rng.integers(8)
        lines = text.split("\n")
        if kind == 0:
            text = text[:at] + text[at + length :]
        elif kind == 1:
            text = text[:at] + pick(rng, NASTY) + text[at:]
        elif kind == 2:
            text = text[:at] + text[at : at + length] * int(rng.integers(2, 5)) + text[at + length :]
        elif kind == 3:
            row = rng.integers(len(lines))
            lines[row] = lines[row].partition(":")[0] + ": " + pick(rng, NASTY)
            text = "\n".join(lines)
        elif kind == 4:
            lines.insert(rng.integers(len(lines) + 1), pick(rng, lines))
            text = "\n".join(lines)
        elif kind == 5:
            del lines[rng.integers(len(lines))]
            text = "\n".join(lines)
        elif kind == 6:
            text = text[:at] + chr(int(rng.integers(0, 0xD7FF))) + text[at + 1 :]
        else:
            text = text.replace(pick(rng, KEYS), pick(rng, NASTY)[:100], 1)
    return text[:300_000]


def damaged_bytes(rng: np.random.Generator, content: bytes, low: int = 0) -> bytes:
    """Change bytes from `low` on: flips, numbers, cuts, insertions."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(low, max(low + 1, len(data))))
        kind = rng.integers(7)
        if kind < 2 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 2 and at < len(data):
            data[at] = pick(rng, (0, 1, 0x7F, 0x80, 0xFF))
        elif kind == 3:
            number = pick(rng, (0, 1, 2**16, 2**31 - 1, 2**32 - 1, 2**40, 2**63, 2**64 - 1))
            size = pick(rng, (2, 4, 8))
            data[at : at + size] = number.to_bytes(8, pick(rng, ("little", "big")))[:size]
        elif kind == 4 and rng.random() < 0.4:
            del data[at:]
        elif kind == 5:
            del data[at : at + int(rng.integers(1, 64))]
        else:
            data[at:at] = rng.bytes(int(rng.integers(1, 64)))
    return bytes(data)


def bomb(rng: np.random.Generator) -> str:
    """Write a YAML text whose aliases stand for billions of values."""
    width, depth = int(rng.integers(2, 12)), int(rng.integers(3, 30))
    key = pick(rng, KEYS)
    lines = ["a0: &a0 [x, y]"] + [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * width)}]" for n in range(1, depth)]
    return "\n".join([*lines, f"{key}: *a{depth - 1}"])


def odd_file(rng: np.random.Generator, folder: Path, name: str, content: bytes) -> Path:
    """Write a file, or now and then put something else in its place; return its path."""
    path = folder / name
    kind = rng.integers(60)
    if kind == 0:
        os.mkfifo(path)
    elif kind == 1:
        path.mkdir()
    elif kind == 2:
        path.symlink_to("/nowhere")
    elif kind == 3:
        path.symlink_to("/dev/zero")
    elif kind == 4:
        path.symlink_to(path)
    elif kind == 5:
        with path.open("wb") as file:
            file.write(content[:100])
            file.truncate(int(pick(rng, (10**6, 10**8, 5 * 10**9))))
    elif kind == 6:
        path.write_bytes(b"")
    else:
        path.write_bytes(content)
    return path


def encoded(rng: np.random.Generator, text: str) -> bytes:
    """Write a text as bytes, seldom as others than UTF-8."""
    encoding = "utf-16" if rng.random() < 0.02 else "utf-8"
    return text.encode(encoding, errors="replace")


# Scenarios and settings.


@functools.cache
def scenario_texts() -> list[str]:
    """The scenarios and parameter files of config/."""
    files = [*(ROOT / "config" / "scenarios").glob("*.yaml"), ROOT / "config" / "predictor.yaml"]
    return [file.read_text(encoding="utf-8") for file in sorted(files)]


@functools.cache
def parameter_names() -> list[str]:
    """All names that --set takes."""
    from robot_formation.components import catalogue
    from robot_formation.experiment.scenario_setup import Setup
    from robot_formation.parameters import specs

    return [
        *specs(Setup),
        *(f"{kind}.{name}" for kind in catalogue.KINDS for name in specs(catalogue.KINDS[kind].parameter_class())),
    ]


def scenario(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A scenario file, damaged or made up."""
    way = rng.integers(10)
    if way == 0:
        text = bomb(rng)
    elif way < 4:
        rows = (f"{pick(rng, parameter_names())}: {pick(rng, NASTY)}" for _ in range(rng.integers(1, 6)))
        nested = [row if rng.random() < 0.5 else row.replace(".", ":\n  ", 1) for row in rows]
        text = "\n".join(nested)
    else:
        text = damaged_text(rng, pick(rng, scenario_texts()))
    return ["scenario", odd_file(rng, folder, "scenario.yaml", encoded(rng, text)), *setting(rng, 0.2)]


def setting(rng: np.random.Generator, probability: float = 1.0) -> list[str]:
    """KEY=VALUE, usually wrong."""
    if rng.random() > probability:
        return []
    key = pick(rng, parameter_names()) if rng.random() < 0.8 else damaged_text(rng, pick(rng, parameter_names()))
    value = pick(rng, NASTY) if rng.random() < 0.7 else damaged_text(rng, pick(rng, NASTY))
    return [f"{key}={value}" if rng.random() < 0.95 else value]


def settings(rng: np.random.Generator, folder: Path) -> list[str]:
    """Settings of a preset."""
    return ["scenario", "", *(word for _ in range(rng.integers(1, 4)) for word in setting(rng))]


# Logs.


def log(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A log of displacements."""
    columns = ["u_m", "v_m", "residual_u_m", "residual_v_m", "commanded_u_m", "commanded_v_m"][
        : pick(rng, (2, 4, 6, 6))
    ]
    scale = pick(rng, (0.05, 0.05, 0.05, 1e-300, 0.0, 10.0, 1e200))
    rows = rng.normal(0.0, scale, (int(rng.integers(0, 30)), len(columns)))
    lines = [",".join(columns), *(",".join(f"{value:.6g}" for value in row) for row in rows)]
    text = "\n".join(lines) + "\n"
    if rng.random() < 0.8:
        text = damaged_text(rng, text)
    if rng.random() < 0.03:
        text += "0.01,0.05," * int(rng.integers(1, 60_000))
    path = odd_file(rng, folder, "log.csv", encoded(rng, text))
    name = pick(rng, ("previous", "measured", "formation", "literal", "edmd", "x"))
    choice = ["--predictor", name] if rng.random() < 0.95 else []
    extra = pick(
        rng, ([], ["--json"], ["--set", f"predictor.{pick(rng, ('forgetting', 'max_u_m'))}={pick(rng, NASTY)}"])
    )
    return ["predict", path, "--no-figure", *choice, *extra]


# Bags.


@functools.cache
def base_bags() -> dict[str, dict[str, bytes]]:
    """Bags to damage, as files by name: ours in chunks with and without compression, and an SQLite one of rosbags."""
    import tempfile

    from rosbags.rosbag2 import StoragePlugin, Writer

    from robot_formation.bag.reader import read_bag
    from robot_formation.bag.writer import BagWriter
    from synthetic_bag import STORE, Step, SyntheticRun

    made = {}
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("none", "zstd", "lz4"):
            path = Path(folder, compression)
            with BagWriter(path, compression=compression) as writer:
                writer.write_metadata("robot_formation", {"scenario": "made up", "seed": "1", "parameters": "{}"})
                run = SyntheticRun(writer)
                for _ in range(4):
                    run.step(Step(corrections=[(0.001, 0.002)], residual=(0.001, 0.0), prediction=(0.001, 0.05)))
            made[compression] = contents(path)
        sqlite = Path(folder, "sqlite")
        with (
            read_bag(Path(folder, "none")) as bag,
            Writer(sqlite, version=9, storage_plugin=StoragePlugin.SQLITE3) as out,
        ):
            there = {name: out.add_connection(name, kind, typestore=STORE) for name, kind in bag.topics.items()}
            for raw in bag.raw_messages(bag.topics):
                out.write(there[raw.topic], raw.stamp_ns, raw.cdr)
        made["sqlite"] = contents(sqlite)
    return made


def contents(folder: Path) -> dict[str, bytes]:
    """A folder's files by name."""
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def unchecked(content: bytes) -> bytes:
    """Take the check sums out of an MCAP file's chunks and its end, so that damage within is not found by them."""
    data = bytearray(content)
    at = 8
    while at + 9 <= len(data):
        kind, (length,) = data[at], struct.unpack_from("<Q", data, at + 1)
        if kind == 6:
            data[at + 9 + 24 : at + 9 + 28] = bytes(4)
        if kind in (2, 15):
            data[at + 9 + length - 4 : at + 9 + length] = bytes(4)
        at += 9 + length
    return bytes(data)


def bag(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A bag with a damaged file, and a verb that reads it."""
    kind = pick(rng, ("none", "none", "none", "zstd", "lz4", "sqlite"))
    files = dict(base_bags()[kind])
    path = folder / "bag"
    path.mkdir()
    target = pick(rng, list(files)) if rng.random() < 0.6 else next(name for name in files if name != "metadata.yaml")
    if kind == "none" and rng.random() < 0.7:
        files = {name: unchecked(data) if name.endswith(".mcap") else data for name, data in files.items()}
    for name, data in files.items():
        if name != target:
            (path / name).write_bytes(data)
        elif name == "metadata.yaml":
            text = bomb(rng) if rng.random() < 0.03 else damaged_text(rng, data.decode())
            odd_file(rng, path, name, encoded(rng, text))
        else:
            odd_file(rng, path, name, data if rng.random() < 0.02 else damaged_bytes(rng, data))
    if kind == "sqlite" and rng.random() < 0.5:
        damage_table(rng, path / next(name for name in files if name.endswith(".db3")))
    if rng.random() < 0.15:
        (path / "metadata.yaml").unlink(missing_ok=True)
    whole = path if rng.random() < 0.8 else path / next(name for name in files if name != "metadata.yaml")
    return reading(rng, whole, folder)


DETAILS = ("parameters", "versions", "seed", "timesteps", "dropped", "lost", "outcome")


def run_details(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A whole bag whose metadata says other things of the run than a run does."""
    from robot_formation.bag.writer import BagWriter
    from synthetic_bag import Step, SyntheticRun

    groups: dict[str, dict[str, Any]] = {
        "world": {"robots": ["leader", "follower_1"], "marker.top_m": 0.216},
        "fine_tuner": {"mode": "paper"},
    }
    odd: tuple[Any, ...] = (None, 5, -1, 1e300, True, "x", "\ud800", [], [[]], {}, {"a": {}}, *NASTY)
    for group in groups.values():
        for name in group:
            group[name] = pick(rng, odd) if rng.random() < 0.5 else group[name]
    details = {"scenario": "made up", "seed": "1", "parameters": json.dumps(groups)}
    for key in DETAILS:
        way = rng.integers(6)
        if way == 0:
            details[key] = pick(rng, (*NASTY, "[" * 100_000, '{"world": ' * 100_000))
        elif way == 1:
            details[key] = json.dumps(pick(rng, odd))
        elif way == 2:
            details[key] = damaged_text(rng, details.get(key, '{"/clock": 3}'))
    path = folder / "bag"
    with BagWriter(path) as writer:
        texts = {key: text.encode("utf-8", "replace").decode() for key, text in details.items()}
        writer.write_metadata("robot_formation", texts)
        run = SyntheticRun(writer)
        for _ in range(2):
            run.step(Step(corrections=[(0.001, 0.002)], residual=(0.001, 0.0), prediction=(0.001, 0.05)))
    return reading(rng, path, folder)


def reading(rng: np.random.Generator, path: Path, folder: Path) -> list[Path | str]:
    """A verb that reads a bag."""
    verb = pick(rng, RECEIVERS)
    json_too = ["--json"] if rng.random() < 0.4 else []
    if verb == "predict":
        return ["predict", "--bag", path, "--no-figure", "--predictor", "measured", *json_too]
    options = {
        "analyze": ["--no-pictures"],
        "recover": ["--out", folder / "saved"],
        "replay": pick(
            rng, ([], ["--fine-tuner"], ["--detector"], ["--set", f"predictor.forgetting={pick(rng, NASTY)}"])
        ),
    }
    return [verb, path, *options.get(verb, []), *json_too]


def damage_table(rng: np.random.Generator, path: Path) -> None:
    """Put other values into a database's cells: SQLite takes any."""
    import sqlite3

    columns = {
        "topics": ("id", "name", "type", "serialization_format", "offered_qos_profiles", "type_description_hash"),
        "messages": ("topic_id", "timestamp", "data"),
        "message_definitions": ("topic_type", "encoding", "encoded_message_definition"),
        "schema": ("schema_version", "ros_distro"),
    }
    values = (None, "", "x", b"", b"\xff" * 10, 0, -1, 2**62, 1e300, "- 1", "std_msgs/msg/String", "/follower_1/moved")
    try:
        with sqlite3.connect(path) as database:
            script = "".join(
                line
                for (line,) in database.execute("SELECT sql || ';' FROM sqlite_master WHERE sql IS NOT NULL").fetchall()
            )
            tables = {name: database.execute(f"SELECT * FROM {name}").fetchall() for name in columns}
        path.unlink()
        with sqlite3.connect(path) as database:
            database.executescript(script.replace("NOT NULL", "").replace("INTEGER PRIMARY KEY", "BLOB"))
            for name, rows in tables.items():
                for row in rows:
                    database.execute(f"INSERT INTO {name} VALUES ({','.join('?' * len(row))})", row)
            for _ in range(rng.integers(1, 4)):
                name = pick(rng, list(columns))
                column = pick(rng, columns[name])
                where = "" if rng.random() < 0.3 else " WHERE rowid % 7 = 1"
                database.execute(f"UPDATE {name} SET {column} = ?{where}", (pick(rng, values),))
        database.close()
    except (sqlite3.Error, OSError):
        return  # it is damaged already


@functools.cache
def zstd_bomb() -> list[bytes]:
    """Frames of a gigabyte of zeros: one that says so, and one that doesn't."""
    import zstandard

    block = bytes(1 << 24)
    frames = []
    for size in (64 << 24, -1):
        packer = zstandard.ZstdCompressor(level=1).compressobj(size=size)
        frames.append(b"".join(packer.compress(block) for _ in range(64)) + packer.flush())
    return frames


def packed_bag(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A bag whose files or chunks unpack to gigabytes, or that is compressed as a whole and damaged."""
    import zstandard

    files = base_bags()["none"]
    name = next(name for name in files if name.endswith(".mcap"))
    path = folder / "bag"
    path.mkdir()
    if rng.random() < 0.5:
        whole = pick(rng, zstd_bomb()) if rng.random() < 0.3 else zstandard.compress(files[name])
        content = whole if rng.random() < 0.3 else damaged_bytes(rng, whole)
        odd_file(rng, path, f"{name}.zstd", content)
        text = files["metadata.yaml"].decode().replace(name, f"{name}.zstd")
        text = text.replace("compression_format: ''", "compression_format: zstd")
        text = text.replace("compression_mode: ''", f"compression_mode: {pick(rng, ('FILE', 'file', 'MESSAGE', 'x'))}")
        (path / "metadata.yaml").write_text(text)
        return reading(rng, path, folder)
    data, packed = bytearray(files[name]), pick(rng, zstd_bomb())
    at = 8
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    said = pick(rng, (1000, 1 << 20, 64 << 24, 2**40))
    chunk = data[at + 9 : at + 25] + struct.pack("<QII4sQ", said, 0, 4, b"zstd", len(packed)) + packed
    record = b"\x06" + struct.pack("<Q", len(chunk)) + chunk
    # Without an end: it has to be recovered. With one: an index that names the chunk.
    ending = b"" if rng.random() < 0.5 else indexed(data, at, len(record), said, len(packed))
    (path / name).write_bytes(bytes(data[:at]) + record + ending)
    return reading(rng, path / name, folder)


def indexed(data: bytearray, at: int, length: int, said: int, packed: int) -> bytes:
    """The summary of an MCAP file for one chunk: its own schemas and channels, an index, statistics, a footer."""
    summary_start = struct.unpack_from("<Q", data, len(data) - 28)[0]
    kept, place = b"", summary_start
    while data[place] in (3, 4):
        size = 9 + struct.unpack_from("<Q", data, place + 1)[0]
        kept += bytes(data[place : place + size])
        place += size
    index = struct.pack("<QQQQIQI4sQQ", 0, 2**62, at, length, 0, 0, 4, b"zstd", packed, said)
    statistics = struct.pack("<QHIIIIQQI", 5, 1, 1, 0, 0, 1, 0, 2**62, 10) + struct.pack("<HQ", 1, 5)
    records = kept + b"\x08" + struct.pack("<Q", len(index)) + index
    records += b"\x0b" + struct.pack("<Q", len(statistics)) + statistics
    end = b"\x0f" + struct.pack("<QI", 4, 0)
    footer = b"\x02" + struct.pack("<QQQI", 20, at + length + len(end), 0, 0)
    return end + records + footer + b"\x89MCAP0\r\n"


# Pictures, signatures, calibrations, height maps.


@functools.cache
def pictures() -> dict[str, bytes]:
    """Encoded pictures by suffix."""
    import cv2

    first = cv2.imread(str(ROOT / "test" / "data" / "pixy2" / "G1_teach_region.webp"))
    assert first is not None
    suffixes = (".png", ".jpg", ".webp", ".bmp", ".tiff", ".ppm")
    return {suffix: cv2.imencode(suffix, first)[1].tobytes() for suffix in suffixes}


def png(width: int, height: int, depth: int, colour: int, data: bytes) -> bytes:
    """Write a PNG file of these numbers and packed data."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        check_sum = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + check_sum

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@functools.cache
def deflate_bomb() -> bytes:
    """A gigabyte of zeros."""
    packer = zlib.compressobj(1)
    return b"".join(packer.compress(bytes(1 << 24)) for _ in range(64)) + packer.flush()


def picture_file(rng: np.random.Generator, folder: Path) -> Path:
    """A picture, damaged, or one that claims to be huge."""
    way = rng.integers(20)
    suffix = pick(rng, list(pictures()))
    if way == 0:
        size = int(pick(rng, (1, 316, 16_000, 30_000, 2**31 - 1)))
        content, suffix = png(size, size, 8, pick(rng, (0, 2, 3, 6)), zlib.compress(bytes(1000))), ".png"
    elif way == 1:
        content, suffix = png(316, 208, 8, 2, deflate_bomb()), ".png"
    elif way == 2:
        edge = int(pick(rng, (1, 10_000, 2**15, 2**31 - 1)))
        content, suffix = b"P6\n%d %d\n255\n" % (edge, edge) + bytes(100), ".ppm"
    elif way == 3:
        content = rng.bytes(int(rng.integers(0, 2000)))
    else:
        content = damaged_bytes(rng, pictures()[suffix], low=0 if rng.random() < 0.5 else 20)
    return odd_file(rng, folder, f"picture{suffix}", content)


def picture(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A picture in which blocks are looked for, or a colour taught."""
    path = picture_file(rng, folder)
    json_too = ["--json"] if rng.random() < 0.5 else []
    if rng.random() < 0.5:
        return ["detect", path, "--signatures", ROOT / "config" / "signatures.yaml", *json_too]
    numbers = [int(pick(rng, (0, 1, 4, 100, 158, 207, 316, -1, 10**9))) for _ in range(4)]
    place = ["--region", ",".join(map(str, numbers))] if rng.random() < 0.5 else ["--point", "158,104"]
    return ["teach", path, f"{place[0]}={place[1]}", *json_too]


@functools.cache
def good_picture() -> Path:
    """A picture that can be read."""
    import tempfile

    path = Path(tempfile.gettempdir(), f"fuzz_picture_{os.getpid()}.png")
    path.write_bytes(pictures()[".png"])
    return path


def signatures(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """Signatures, or parameters of the detector by our names or PixyMon's."""
    taught = (ROOT / "config" / "signatures.yaml").read_text()
    own = "min_block_area: 20\nsignature_1_range: 3.5\nblock_filtering: 10\nMax tracking distance: 40\n"
    pixymon = "Signature 1 range: 3.5\nMin block area: 20\nAuto white balance: true\nColor code mode: 1\n"
    kind = rng.integers(3)
    text = (taught, own, pixymon)[kind]
    text = bomb(rng) if rng.random() < 0.03 else damaged_text(rng, text)
    if rng.random() < 0.2:
        text = damaged_text(rng, json.dumps({"signatures": [{"sig": 1, "uMin": 1, "uMax": 2}]}))
    path = odd_file(rng, folder, "file.yaml", encoded(rng, text))
    if kind == 0:
        return ["detect", good_picture(), "--signatures", path]
    return ["detect", good_picture(), "--signatures", ROOT / "config" / "signatures.yaml", "--parameters", path]


def calibration(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A calibration of motors or of a camera, in use by a scenario."""
    motors = (
        "robots:\n  leader: {v: [0.0, 20.0, 1.0], u: [0.0, 21.0], turn: [0.0, 3.0]}\n  follower_1: {v: [0.0, 20.0]}\n"
    )
    camera = "alignment: {target_x_px: 158.0, slope_px_per_m: 500.0, side_px_m: 16.0, distance_m: 0.328}\n"
    facts = "measured_with: {world.surface: bowl, drive.wheel_speed_rad_s: 4.0, marker.kind: colours}\n"
    kind = rng.integers(2)
    text = damaged_text(rng, (motors, camera)[kind] + facts) if rng.random() < 0.97 else bomb(rng)
    path = odd_file(rng, folder, "calibration.yaml", encoded(rng, text))
    return ["scenario", "", f"{('drive', 'fine_tuner')[kind]}.calibration_file={path}"]


def height_map(rng: np.random.Generator, folder: Path) -> list[str]:
    """A height map as PNG or NPY, in use by a scenario."""
    edge = int(pick(rng, (4, 5, 16, 64)))
    if rng.random() < 0.5:
        way = rng.integers(6)
        data = deflate_bomb() if way == 0 else zlib.compress((bytes([0]) + bytes(2 * edge)) * edge)
        size = int(pick(rng, (1, 4096, 5000, 30_000, 2**31 - 1))) if way == 1 else edge
        content, name = png(size, size, pick(rng, (16, 16, 16, 8)), pick(rng, (0, 0, 0, 2)), data), "heights.png"
    else:
        stream_kind = pick(rng, ("<f8", "<f4", "<u2", "<i8", "<c16", "|S4"))
        shape = pick(rng, ((edge, edge), (edge, edge), (edge, 3), (edge,), (10**9, 10**9), ()))
        head = repr({"descr": stream_kind, "fortran_order": bool(rng.integers(2)), "shape": shape})
        values = rng.normal(0.0, pick(rng, (1.0, 1e300)), edge * edge)
        content = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head.encode() + b"\n" + values.tobytes()
        name = "heights.npy"
    content = damaged_bytes(rng, content) if rng.random() < 0.7 else content
    path = odd_file(rng, folder, name, content)
    scale = pick(rng, ("", f", scale_m={pick(rng, ('0.1', '1e300', 'nan', 'x', '-1'))}"))
    return ["scenario", "", "world.surface=heightmap", f"world.surface_parameters=[file={path}{scale}]"]


def sweep_folder(rng: np.random.Generator, folder: Path) -> list[Path | str]:
    """A folder of a sweep that was begun."""
    from dataclasses import fields

    from robot_formation.experiment.sweep import Row

    path = folder / "sweep"
    path.mkdir()
    plan = {"tracks": ["one"], "surfaces": ["bowl"], "predictors": ["previous"], "seeds": [0], "settings": []}
    columns = [field.name for field in fields(Row)]
    cells = {"track": "one", "surface": "bowl", "predictor": "previous", "outcome": "done"}
    table = ",".join(columns) + "\n" + ",".join(cells.get(name, "0") for name in columns) + "\n"
    texts = {"sweep.json": json.dumps(plan), "runs.csv": table}
    target = pick(rng, list(texts))
    for name, text in texts.items():
        if name == target:
            odd_file(rng, path, name, encoded(rng, damaged_text(rng, text)))
        else:
            (path / name).write_text(text)
    return ["sweep-table", path]


# Arguments.

_STARTING = ("run", "sweep", "record", "play", "calibrate", "test")
_FINISHING = ("list", "info", "analyze", "predict", "replay", "recover", "detect", "teach", "")
_OPTIONS = (
    *("--json", "--help", "--set", "--seed", "--track", "--surface", "--predictor", "--predictors", "--seeds", "--out"),
    *("--bag", "--robot", "--figure", "--no-figure", "--no-pictures", "--fine-tuner", "--detector", "--signatures"),
    *(
        "--region",
        "--point",
        "--signature",
        "--sensor",
        "--dt-us",
        "--sequence",
        "--rate",
        "--start",
        "--unknown",
        "-o",
    ),
)


def arguments(rng: np.random.Generator, folder: Path) -> list[str]:
    """Verbs with options and words at random."""
    start = rng.random() < 0.4
    verb = pick(rng, _STARTING if start else _FINISHING)
    words = [verb] if verb and rng.random() < 0.95 else [damaged_text(rng, verb)]
    for _ in range(rng.integers(0, 5)):
        word = pick(rng, _OPTIONS) if rng.random() < 0.6 else pick(rng, NASTY)[:200]
        words.append(word if rng.random() < 0.9 else f"{word}={pick(rng, NASTY)[:200]}")
    words = [word.replace("\x00", "") for word in words]
    return ["parse", *words] if start or words[0] not in _FINISHING else words


KINDS: dict[str, tuple[Callable[[np.random.Generator, Path], Sequence[Path | str]], int]] = {
    "scenario file": (scenario, 16),
    "settings": (settings, 12),
    "log": (log, 10),
    "bag": (bag, 24),
    "run details": (run_details, 5),
    "packed bag": (packed_bag, 3),
    "picture": (picture, 8),
    "signatures, parameters": (signatures, 8),
    "calibration": (calibration, 6),
    "height map": (height_map, 5),
    "sweep folder": (sweep_folder, 3),
    "arguments": (arguments, 5),
}
