"""What a bag's path stands for: a folder with `metadata.yaml`, one file, or what a killed writer left of either.

Files that rosbag2 compressed as a whole (`compression_mode: file`) are unpacked into a temporary folder, and unclosed
bags are recovered into one.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path, PurePath

import zstandard

from robot_formation.bag.bag_path import PARTIAL_SUFFIX
from robot_formation.bag.errors import BagError
from robot_formation.bag.mcap_records import MAGIC
from robot_formation.bag.mcap_source import has_index
from robot_formation.bag.recover import in_order, mcap_files, recover
from robot_formation.errors import shown
from robot_formation.system.files import check_file, open_file, size_text
from robot_formation.system.temporary_folder import BAG, temporary_folder
from robot_formation.system.yaml_files import read_yaml

METADATA_FILE = "metadata.yaml"
_STORAGES = (".mcap", ".db3")
_PACKED = ".zstd"
_BLOCK_BYTES = 1 << 20
# Recordings shrink to a tenth or so; what was made to fill a disk shrinks to a thousandth and less.
_MOST_RATIO = 200
_SMALL_BYTES = 64 << 20


@dataclass(frozen=True)
class FolderMetadata:
    """What a bag's `metadata.yaml` says.

    Attributes:
        files: the storage files, in order.
        counts: messages by topic.
        type_hashes: by topic; empty where it has none.
        ros_distro: that recorded the bag; empty if it doesn't say.
        compression_format: `zstd` if rosbag2 itself compressed.
        compression_mode: what it compressed: `file`, `message`, or nothing.
    """

    files: tuple[Path, ...]
    counts: Mapping[str, int] = field(default_factory=dict)
    type_hashes: Mapping[str, str] = field(default_factory=dict)
    ros_distro: str = ""
    compression_format: str = ""
    compression_mode: str = ""


@dataclass(frozen=True)
class Readable:
    """A bag's files as they can be opened: finished, and compressed inside at most.

    Attributes:
        files: in order.
        metadata: of its folder, if it has any.
        recovered: the bag had not been closed by its writer.
    """

    files: Sequence[Path]
    metadata: FolderMetadata | None
    recovered: bool


def readable(path: Path, stack: ExitStack) -> Readable:
    """Find a bag's files, and make finished ones of those that aren't; `stack` removes them again.

    Raises:
        BagError: the path is missing or not a bag, or the bag can't be recovered or unpacked.
    """
    if not path.exists():
        mcap_files(path)  # says so
    metadata = _metadata(path) if path.is_dir() and (path / METADATA_FILE).exists() else None
    files = list(metadata.files) if metadata else storage_files(path)
    if not files or any(storage_of(file) is None for file in files):
        raise BagError(f"{path} is not a bag; give a folder that 'ros2 bag' or this project wrote, or an .mcap file")
    for file in files:
        check_file(file)
    source = path
    if any(file.name.endswith(_PACKED) for file in files):
        source = _temporary(stack)
        files = [_unpacked(file, source) for file in files]
    if storage_of(files[0]) == ".mcap" and _is_unclosed(files, path, metadata):
        target = _temporary(stack) / bag_name(path)
        saved = recover(source, target).path
        return Readable(storage_files(saved), _metadata(saved), recovered=True)
    return Readable(files, metadata, recovered=False)


def storage_files(path: Path) -> list[Path]:
    """List a bag's storage files in order, whichever storage it is."""
    if not path.is_dir():
        return [path]
    return sorted((file for file in path.iterdir() if storage_of(file)), key=in_order)


def bag_name(path: str | Path) -> str:
    """Return a bag's name without the suffixes of unclosed bags and storage files."""
    name = Path(path).resolve().name
    for suffix in (PARTIAL_SUFFIX, _PACKED, ".mcap", ".db3"):
        name = name.removesuffix(suffix)
    return name


def storage_of(file: Path) -> str | None:
    """Return which storage a file is by its name: `.mcap` or `.db3`; None for other files."""
    name = file.name.removesuffix(_PACKED)
    return next((kind for kind in _STORAGES if name.endswith(kind)), None)


def _metadata(folder: Path) -> FolderMetadata:
    path = folder / METADATA_FILE
    remedy = "make it anew with 'ros2 bag reindex', or give the storage file"
    content = read_yaml(path, refuse=BagError, remedy=remedy)
    try:
        said = content["rosbag2_bagfile_information"]
        # Older versions have paths that begin with the folder's name, and none may lead out of it.
        files = tuple(folder / PurePath(str(name)).name for name in said["relative_file_paths"])
        topics = [(topic["topic_metadata"], topic["message_count"]) for topic in said["topics_with_message_count"]]
        counts: dict[str, int] = {}
        for topic, count in topics:
            counts[str(topic["name"])] = counts.get(str(topic["name"]), 0) + int(count)
        metadata = FolderMetadata(
            files,
            counts,
            {str(topic["name"]): str(topic.get("type_description_hash") or "") for topic, _ in topics},
            str(said.get("ros_distro") or ""),
            str(said.get("compression_format") or ""),
            _mode(said.get("compression_mode")),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{shown(error.args[0])} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise BagError(f"{path}: no metadata of a bag: {reason:.200}; {remedy}") from error
    missing = [file.name for file in files if not file.exists()]
    if missing:
        raise BagError(f"{folder} lacks {shown(missing[0])}, which {METADATA_FILE} names; put it back, or {remedy}")
    if metadata.compression_mode and metadata.compression_format != "zstd":
        form = shown(metadata.compression_format)
        raise BagError(f"{folder} is compressed as {form}, which can't be read; 'ros2 bag convert' makes it readable")
    return metadata


def _mode(said: object) -> str:
    mode = str(said or "").lower()
    return "" if mode == "none" else mode


def _is_unclosed(files: Sequence[Path], path: Path, metadata: FolderMetadata | None) -> bool:
    """Return whether MCAP files were never closed by their writer."""
    return (path.is_dir() and metadata is None) or any(_lacks_end(file) or not has_index(file) for file in files)


def _lacks_end(file: Path) -> bool:
    """Return whether an MCAP file begins as one but doesn't end as one."""
    with open_file(file) as stream:
        head = stream.read(len(MAGIC))
        stream.seek(max(0, file.stat().st_size - len(MAGIC)))
        return head == MAGIC and (stream.tell() == 0 or stream.read() != MAGIC)


def _temporary(stack: ExitStack) -> Path:
    folder = stack.enter_context(temporary_folder(BAG)) / "bag"  # beside the file of its owner
    folder.mkdir()
    return folder


def _unpacked(file: Path, folder: Path) -> Path:
    """Unpack a file that was compressed as a whole; return the new one."""
    target = folder / file.name.removesuffix(_PACKED)
    room = shutil.disk_usage(folder).free
    most = min(room, file.stat().st_size * _MOST_RATIO + _SMALL_BYTES)
    with open_file(file) as packed, target.open("xb") as whole:
        try:
            stream = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
            while block := stream.read(_BLOCK_BYTES):
                if whole.tell() + len(block) > most:
                    why = "the temporary folder has no room for" if most == room else "and no recording holds"
                    raise BagError(f"{file} unpacks to more than {size_text(most)}, {why}; unpack it with 'zstd -d'")
                whole.write(block)
        except zstandard.ZstdError as error:
            raise BagError(f"{file} is damaged: {error}") from error
    return target
