"""Write a run as a rosbag2 bag (MCAP) that survives the death of its writer up to the last closed chunk."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

from robot_formation.bag.bag_path import PARTIAL_SUFFIX, check_free, recover_hint
from robot_formation.bag.definitions import Definition, definition
from robot_formation.bag.errors import BagError
from robot_formation.bag.mcap_file import COMPRESSIONS, McapFile
from robot_formation.bag.metadata import bag_information, merged
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.write_options import DEFAULT_OPTIONS, WriteOptions
from robot_formation.system.yaml_files import yaml_text

_LAST_STAMP_NS = 2**63 - 1


@dataclass
class _Topic:
    what: Definition
    profiles: tuple[TopicQos, ...]
    message_count: int = 0
    stamp_ns: int = -1
    log_time_ns: int = -1

    def next_log_time(self, stamp_ns: int) -> int:
        """Return the stamp, or the nanosecond after the topic's last log time where stamps repeat; keep latecomers."""
        if stamp_ns < self.stamp_ns:
            return stamp_ns
        self.stamp_ns = stamp_ns
        self.log_time_ns = max(stamp_ns, self.log_time_ns + 1)
        return self.log_time_ns


class BagWriter:
    """Writes `<path>.partial/` and renames it to `<path>/` when closed: a folder without the suffix is complete.

    The folder holds `<name>_0.mcap`, `<name>_1.mcap`, ... (a file each time the bag is split; every one of them has
    the definitions and metadata that it needs to be read alone) and `metadata.yaml` (version 9, as ROS 2 Jazzy writes
    it). Use it as a context manager; it is closed, and complete as far as it goes, also when the block ends with an
    exception. Once the disk has refused something, nothing more is written: the folder stays partial, to be recovered.

    Args:
        path: the bag's folder; missing parents are made.
        compression: of the chunks, instead of that of the options.
        options: how the files are written.
        partial_suffix: what the folder is called behind its name while it is being written.

    Raises:
        BagError: the bag or its `.partial` exists (nothing is overwritten), or the folder can't be made.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        compression: str | None = None,
        options: WriteOptions = DEFAULT_OPTIONS,
        partial_suffix: str = PARTIAL_SUFFIX,
    ) -> None:
        self.path = Path(path).absolute()
        check_free(self.path, (partial_suffix,))
        self.partial_path = self.path.with_name(self.path.name + partial_suffix)
        self._options = options if compression is None else replace(options, compression=compression)
        if self._options.compression not in COMPRESSIONS:
            given = self._options.compression
            raise BagError(f"compression can't be {given!r}; there are: {', '.join(COMPRESSIONS)}")
        self._topics: dict[str, _Topic] = {}
        self._records: list[tuple[str, dict[str, str]]] = []
        self._finished: list[McapFile] = []
        self._closed = False
        self._failure: BagError | None = None
        with self._system_errors():
            self.partial_path.mkdir(parents=True)
            try:
                self._file = self._next_file()
            except OSError:
                shutil.rmtree(self.partial_path, ignore_errors=True)  # nothing in it yet
                raise

    @property
    def open_bytes(self) -> int:
        """Bytes in the chunk that is not closed yet: what a killed writer would lose."""
        return self._file.open_bytes

    @property
    def message_count(self) -> int:
        """Messages written so far."""
        return sum(topic.message_count for topic in self._topics.values())

    @property
    def message_counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.message_count for name, topic in self._topics.items()}

    def add_topic(
        self,
        name: str,
        type_name: str,
        qos: TopicQos | tuple[TopicQos, ...],
        *,
        embedded: Definition | None = None,
    ) -> None:
        """Declare a topic.

        Args:
            name: absolute topic name.
            type_name: message type in full, `std_msgs/msg/String`.
            qos: what the topic's publisher offers, or each of several publishers.
            embedded: the type's definition; by default that of ROS 2 Jazzy.

        Raises:
            BagError: the topic was declared before, or the type is unknown.
        """
        self._check_open()
        if name in self._topics:
            raise BagError(f"{self.path}: topic '{name}' was added before; add each topic once")
        what = embedded or definition(type_name)
        entry = _Topic(what, (qos,) if isinstance(qos, TopicQos) else qos)
        with self._system_errors():
            self._file.add_topic(name, what, entry.profiles)
        self._topics[name] = entry

    def write(self, topic: str, cdr: bytes, stamp_ns: int, *, log_time_ns: int | None = None) -> None:
        """Append one serialised message.

        Publish time is the stamp. Log time is the stamp too, but for messages of one topic with equal stamps (a world
        that stands still) it counts up by a nanosecond, because players may reorder equal log times.

        Args:
            topic: a name given to `add_topic`.
            cdr: the message as CDR with its encapsulation header.
            stamp_ns: nanoseconds, 0 to 2^63 - 1.
            log_time_ns: keep this log time instead (copies of another recorder's bag).

        Raises:
            BagError: unknown topic, a stamp out of range, or the file can't be written (disk full).
        """
        self._check_open()
        entry = self._topics.get(topic)
        if entry is None:
            raise BagError(f"{self.path}: topic '{topic}' is unknown; add it with its type first")
        log_time = entry.next_log_time(stamp_ns) if log_time_ns is None else log_time_ns
        if not (0 <= stamp_ns <= _LAST_STAMP_NS and 0 <= log_time <= _LAST_STAMP_NS):
            raise BagError(f"{self.path}: '{topic}' has a message stamped {stamp_ns} ns; give stamps of 0 to 2^63 - 1")
        try:
            if self._file.open_bytes >= self._options.chunk_bytes:
                self._file.end_chunk()
            if self._is_full(log_time):
                self._split()
            self._file.write(topic, cdr, log_time, stamp_ns)
        except OSError as error:
            raise self._unwritable(error) from error
        entry.message_count += 1

    def end_chunk(self) -> None:
        """Close the current chunk and hand it to the operating system: what was written survives SIGKILL.

        A crash of the machine itself can still lose it (there is no fsync).

        Raises:
            BagError: the file can't be written.
        """
        self._check_open()
        with self._system_errors():
            self._file.end_chunk()

    def write_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write an MCAP metadata record at this place, and at the beginning of every later file.

        Raises:
            BagError: a value isn't a string, or the file can't be written.
        """
        self._check_open()
        wrong = [key for key, value in values.items() if not isinstance(value, str)]
        if wrong:
            raise BagError(f"{self.path}: metadata '{name}' must hold strings only; convert {', '.join(wrong)}")
        self._records.append((name, dict(values)))
        with self._system_errors():
            self._file.write_metadata(name, values)

    def close(self) -> Path:
        """Finish the file, write `metadata.yaml` and give the folder its final name; return its path.

        Raises:
            BagError: the file can't be written, or the path has been taken meanwhile; the `.partial` folder stays.
        """
        if self._closed:
            return self.path
        self._closed = True
        with self._system_errors():
            self._finish_file()
        if self.path.exists():
            raise BagError(f"{self.path} was made by somebody else meanwhile; the bag stays in {self.partial_path}")
        with self._system_errors():
            text = yaml_text({"rosbag2_bagfile_information": self._information(self._finished)})
            (self.partial_path / "metadata.yaml").write_text(text, encoding="utf-8")
            self.partial_path.rename(self.path)
        return self.path

    def discard(self) -> None:
        """Remove what was written of a bag that is not closed."""
        if self.partial_path.exists():
            self._closed = True
            self._file.abandon()
            shutil.rmtree(self.partial_path)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _is_full(self, log_time_ns: int) -> bool:
        options, file = self._options, self._file
        if file.message_count == 0:
            return False
        too_large = 0 < options.split_bytes < file.bytes_written
        return too_large or 0 < options.split_ns < log_time_ns - file.span.first_ns

    def _split(self) -> None:
        self._finish_file()
        self._file = self._next_file()

    def _next_file(self) -> McapFile:
        """Begin a file with the topics and metadata of those before it."""
        path = self.partial_path / f"{self.path.name}_{len(self._finished)}.mcap"
        file = McapFile(path, compression=self._options.compression)
        for name, values in self._records:
            file.write_metadata(name, values)
        for name, topic in self._topics.items():
            file.add_topic(name, topic.what, topic.profiles)
        return file

    def _finish_file(self) -> None:
        # rosbag2 looks up in this record which version the channels' QoS text follows.
        self._file.write_metadata("rosbag2", {"serialized_metadata": yaml_text(self._information([self._file]))})
        self._file.finish()
        self._finished.append(self._file)

    def _information(self, files: Sequence[McapFile]) -> dict[str, object]:
        return bag_information([(file.path.name, file.message_count, file.span) for file in files], merged(files))

    def _check_open(self) -> None:
        if self._failure is not None:
            raise self._failure
        if self._closed:
            raise BagError(f"{self.path} is closed; nothing more can be written to it")

    @contextmanager
    def _system_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> BagError:
        """Abandon the bag: what is on the disk stays, to be recovered."""
        self._closed = True
        text = f"{self.path}: can't write the bag: {error.strerror or error}; free space or choose another path"
        if hasattr(self, "_file"):
            self._file.abandon()
        if hasattr(self, "_file") and self.partial_path.suffix == PARTIAL_SUFFIX:
            text += recover_hint(self.partial_path)
        self._failure = BagError(text)
        return self._failure
