"""Random input to the block detector: image messages, image files, signature and parameter files.

Everything must end in blocks, a dropped message or a FormationError of one line. Memory is compared between the end of
the warm-up (the first tenth of the time, at least 500 cases) and the end: if the resident set has grown by more than
--limit-mb, or anything else is raised, the exit code is 1. A crash of the process ends it, of course, with another one.

Run: python bench/fuzz_detector.py [--minutes 10] [--cases N] [--seed N] [--limit-mb 16]
"""

from __future__ import annotations

import argparse
import array
import contextlib
import io
import json
import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import yaml
from sensor_msgs.msg import Image

from robot_formation import conversions
from robot_formation.components.base import Place
from robot_formation.components.block_detector import BlockDetectorComponent
from robot_formation.components.node_parameters import BlockDetectorNodeParameters
from robot_formation.errors import FormationError
from robot_formation.vision.pixy2.detector import BlockDetector
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.pixy2.picture_files import read_parameters, read_picture
from robot_formation.vision.pixy2.signatures import load_signatures, teach_point, teach_region

DATA = Path(__file__).parent.parent / "test" / "data" / "pixy2"
EXAMPLES = json.loads((DATA / "examples.json").read_text(encoding="utf-8"))
ENCODINGS = ("rgb8", "bgr8", "rgb8", "bgr8", "mono8", "rgba8", "16UC1", "bayer_bggr8", "", "\x00", "rgb8 ", "\n")
SIZES = (0, 1, 2, 3, 7, 104, 158, 208, 315, 316, 317, 632, 948, 1000, 2**15, 2**16, 2**31, 2**32 - 1)
FORMATS = (".png", ".jpg", ".webp", ".bmp", ".tiff", ".ppm")
NUMBERS = (0, -1, 1, 2**31, -(2**31), 2**63, 10**400, 0.5, 1e308)
OTHERS: tuple[Any, ...] = ("", "1", "a\nb", None, True, [], [5.0, 6.0], [None], {}, {"a": {"b": 1}}, [[1]], ["x"] * 100)
VALUES = NUMBERS + OTHERS
LARGEST = 4_000_000
WARM_UP_CASES = 500


class Fuzzer:
    """Makes cases from a seed and counts how they end."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.rng = np.random.default_rng(seed)
        self.folder = folder
        self.outcomes: Counter[str] = Counter()
        self.failures: list[str] = []
        self.component = BlockDetectorComponent(BlockDetectorNodeParameters(), Place("follower_1"))
        self.component.attach(lambda topic, message: self.sent.append(topic.name), lambda level, text: None)
        self.sent: list[str] = []
        self.stamp_ns = 0
        stored = cv2.imread(str(DATA / "seqA_20.webp"))
        assert stored is not None
        picture = stored.astype(np.uint8, copy=False)
        self.pictures = [picture, np.repeat(picture, 2, axis=1), np.zeros((3, 2, 3), np.uint8)]
        self.encoded = [
            cv2.imencode(extension, picture)[1].ravel().astype(np.uint8, copy=False)
            for extension in FORMATS
            for picture in self.pictures
        ]

    def detector(self) -> BlockDetector:
        """The component's detector of colours."""
        detector = self.component._detector
        assert isinstance(detector, BlockDetector)
        return detector

    def run_one(self) -> None:
        """One case of a random kind; what must not be raised is kept."""
        kinds = (self.message, self.message, self.image_file, self.signatures_file, self.parameters_file)
        kind = kinds[self.rng.integers(len(kinds))]
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                outcome = kind()
        except FormationError as error:
            outcome = "refused"
            if "\n" in str(error):
                self.failures.append(f"{kind.__name__}: an error of several lines: {error!r}")
        except Exception:
            outcome = "failed"
            self.failures.append(f"{kind.__name__}:\n{traceback.format_exc()}")
        self.outcomes[f"{kind.__name__} {outcome}"] += 1

    def message(self) -> str:
        """An image message with random header, size, encoding and data."""
        rng = self.rng
        width: int | np.int64
        height: int | np.int64
        if rng.random() < 0.6:
            width, height = rng.integers(1, 700), rng.integers(1, 500)
        else:
            width, height = self._pick(SIZES), self._pick(SIZES)
        if rng.random() < 0.3:
            width, height = 316, 208
        step = 3 * int(width) + self._pick((0, 0, 0, 1, 4, 100, -1)) if rng.random() < 0.8 else self._pick(SIZES)
        step = min(max(step, 0), 2**32 - 1)
        size = min(step * int(height), LARGEST)
        size = max(0, size + self._pick((0, 0, 0, 0, 0, 0, 1, -1, -step)))
        message = Image(width=int(width), height=int(height), step=step, is_bigendian=int(rng.integers(256)))
        message.encoding = self._pick(ENCODINGS)
        message.header.frame_id = "x" * self._pick((0, 1, 1000))
        # Clocks go on, stand, step back a little, or jump.
        self.stamp_ns += self._pick((16_200_000, 33_333_333, 33_333_333, 33_333_333, 1, 0, -1_000_000, 10**12))
        message.header.stamp = conversions.to_time(max(self.stamp_ns, 0) % (2**31 * 10**9))
        message.data = array.array("B", self._data(size))
        self.component.listened_to(self.component.outputs()[1], int(rng.integers(2)))
        self.sent.clear()
        self.component.inputs()[0].handler(message)
        return "answered" if self.sent else "dropped"

    def _data(self, size: int) -> bytes:
        """Bytes of noise, of one value, or of a picture over and over."""
        draw = self.rng.random()
        if draw < 0.3:
            return self.rng.bytes(size)
        if draw < 0.5:
            return bytes([int(self.rng.integers(256))]) * size
        content = self.pictures[1].tobytes()
        return (content * (size // len(content) + 1))[:size]

    def image_file(self) -> str:
        """An image file that is cut off, bit-flipped, spliced or nothing but noise; detect, and sometimes teach."""
        content = self._damaged(self.encoded[self.rng.integers(len(self.encoded))])
        path = self.folder / "case.img"
        path.write_bytes(content)
        picture = read_picture(path, lambda text: None)
        self.detector().detect(picture)
        if self.rng.random() < 0.3:
            x, y, width, height = (int(value) for value in self.rng.integers(-5, 330, 4))
            teach_region(picture, (x, y, width, height), 1)
            teach_point(picture, (x, y), int(self.rng.integers(0, 10001)), 1)
        return "read"

    def signatures_file(self) -> str:
        """A file of signatures with random bounds, damaged or not; the detector is built from it and used."""
        listed = [dict(s) for s in EXAMPLES["groups"]["G1"]["signatures"]]
        for signature in listed:
            if self.rng.random() < 0.5:
                signature[self._pick(tuple(signature))] = self._value()
        path = self._write({"signatures": listed} if self.rng.random() < 0.9 else self._value())
        signatures = load_signatures(path)
        detector = BlockDetector(signatures, DetectorParameters(signature_range=(float(self.rng.uniform(0, 25)),) * 7))
        detector.detect(cv2.resize(self.pictures[1], (316, 208)))
        return "read"

    def parameters_file(self) -> str:
        """A file of parameters with random names and values, damaged or not; the detector is built from it and used."""
        names = (
            *DetectorParameters.__dataclass_fields__,
            "Signature 1 range",
            "camera_brightness",
            "",
            "x",
            "LED brightness",
        )
        values = {self._pick(names): self._value() for _ in range(self.rng.integers(0, 5))}
        path = self._write(values if self.rng.random() < 0.9 else self._value())
        parameters = read_parameters(path, lambda text: None)
        detector = self.detector()
        detector.configure(detector.signatures, parameters)
        return "read"

    def _write(self, content: Any) -> Path:
        text = json.dumps(content) if self.rng.random() < 0.5 else yaml.safe_dump(content)
        data = text.encode()
        if self.rng.random() < 0.4:
            data = self._damaged(np.frombuffer(data, np.uint8))
        path: Path = self.folder / self._pick(("case.yaml", "case.json"))
        path.write_bytes(data)
        return path

    def _damaged(self, content: npt.NDArray[np.uint8]) -> bytes:
        rng = self.rng
        draw = rng.random()
        if draw < 0.1:
            return rng.bytes(int(rng.integers(0, 3000)))
        damaged = np.array(content)
        if draw < 0.5:
            damaged = damaged[: rng.integers(0, len(damaged) + 1)]
        if draw > 0.3 and len(damaged):
            # The first bytes hold the sizes and tables: hit them often.
            reach = min(len(damaged), 64) if rng.random() < 0.3 else len(damaged)
            for place in rng.integers(0, reach, rng.integers(1, 6)):
                damaged[place] = rng.integers(256) if rng.random() < 0.5 else damaged[place] ^ (1 << rng.integers(8))
        if draw > 0.9:
            start = int(rng.integers(0, len(damaged) + 1))
            damaged = np.concatenate([damaged[start:], damaged[:start], damaged])
        return damaged.tobytes()

    def _value(self) -> Any:
        """A value of any kind that YAML and JSON know, mostly a number."""
        if self.rng.random() < 0.4:
            return int(self.rng.integers(-40000, 40000))
        return self._pick(VALUES)

    def _pick(self, choices: tuple[Any, ...]) -> Any:
        return choices[self.rng.integers(len(choices))]


def resident_mb() -> float:
    """Resident set of this process, megabytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _silent(text: str) -> None:
    """Take no notice."""


def fuzz(
    fuzzer: Fuzzer, *, minutes: float | None = None, cases: int | None = None, say: Callable[[str], None] = _silent
) -> tuple[int, float, float, float]:
    """Run for some minutes or cases; return the cases done and the megabytes after warm-up, at most and at the end."""
    began = reported = time.monotonic()
    end = began + 60.0 * minutes if minutes else float("inf")
    done, most = 0, 0.0
    warm: float | None = None
    while (cases is None or done < cases) and time.monotonic() < end and len(fuzzer.failures) < 5:
        fuzzer.run_one()
        done += 1
        now = time.monotonic()
        warmed_up = done >= cases / 10 if cases else done >= WARM_UP_CASES and now - began >= (end - began) / 10
        if warm is None and warmed_up:
            warm = resident_mb()
        if done % 100 == 0:
            most = max(most, resident_mb())
        if now - reported >= 60.0:
            reported = now
            say(f"{(now - began) / 60.0:4.1f} min  {done} cases  {resident_mb():.0f} MB")
    return done, warm if warm is not None else resident_mb(), most, resident_mb()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="how long (default: 10)")
    parser.add_argument("--cases", type=int, help="a fixed number of cases instead")
    parser.add_argument("--seed", type=int, default=1, help="seed of the cases (default: 1)")
    parser.add_argument("--limit-mb", type=float, default=16.0, help="allowed growth after the warm-up (default: 16)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        fuzzer = Fuzzer(args.seed, Path(folder))
        done, warm, most, final = fuzz(
            fuzzer,
            minutes=None if args.cases else args.minutes,
            cases=args.cases,
            say=lambda text: print(text, flush=True),
        )
    for outcome, count in sorted(fuzzer.outcomes.items()):
        print(f"{outcome:28} {count:8}")
    growth = final - warm
    print(f"{done} cases, seed {args.seed}; resident {warm:.1f} MB after the warm-up, {final:.1f} MB at the end")
    print(f"growth {growth:+.1f} MB (limit {args.limit_mb:.0f} MB, most {most:.1f} MB at any time)")
    for failure in fuzzer.failures:
        print(failure, file=sys.stderr)
    return 1 if fuzzer.failures or growth > args.limit_mb else 0


if __name__ == "__main__":
    sys.exit(main())
