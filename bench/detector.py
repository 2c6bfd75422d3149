"""Milliseconds per 316 x 208 picture: the block detector against the usual OpenCV pipeline, in the same run.

The usual pipeline is cvtColor to HSV, inRange per signature and connectedComponentsWithStats per mask; it does less
(no row scanner, no merging, no nesting), but it is what people write. Each figure is the median over interleaved rounds
of the fastest call in a round.

Run: python bench/detector.py [--rounds N]
"""

import argparse
import colorsys
import json
import statistics
import sys
import time
from pathlib import Path

import cv2
import numpy as np

from robot_formation.parameters import from_mapping
from robot_formation.vision.color_table import ColorTable
from robot_formation.vision.detector import BlockDetector
from robot_formation.vision.parameters import DetectorParameters
from robot_formation.vision.signatures import Signature

DATA = Path(__file__).parent.parent / "test" / "data" / "pixy2"
SCENES = {
    "marker 46 px": ("seqA_20.webp", "G1"),
    "marker near": ("seqA_47.webp", "G1"),
    "two markers": ("G3_22_two_markers.webp", "G3"),
    "specks": ("G4_21_specks.webp", "G4"),
    "distractors": ("G1_19_distractors.webp", "G1"),
    "18 blobs": ("G5_20_many_blobs.webp", "G5"),
    "split faces": ("G3_17_split_h.webp", "G3"),
    "fills the frame": ("G5_00_frontal_near.webp", "G5"),
    "no marker": ("G1_24_no_marker_sky.webp", "G1"),
}
CALLS = 20


def hsv_ranges(signatures):
    """Usual HSV limits (hue +-10 of 180, saturation and value from 80) around the taught colours."""
    ranges = []
    for signature in signatures:
        red, green, blue = (signature.rgb >> shift & 255 for shift in (16, 8, 0))
        hue = round(colorsys.rgb_to_hsv(red / 255, green / 255, blue / 255)[0] * 180)
        ranges.append((np.array((max(hue - 10, 0), 80, 80)), np.array((min(hue + 10, 179), 255, 255))))
    return ranges


def usual_pipeline(image, ranges):
    """Boxes (x, y, width, height, area) of the components of each colour's mask of at least 40 pixels."""
    hsv = cv2.cvtColor(image, cv2.COLOR_RGB2HSV)
    found = []
    for low, high in ranges:
        _, _, stats, _ = cv2.connectedComponentsWithStats(cv2.inRange(hsv, low, high))
        found.append(stats[1:][stats[1:, cv2.CC_STAT_AREA] >= 40])
    return found


def fastest_ms(call):
    """Fastest of some calls, milliseconds."""
    best = float("inf")
    for _ in range(CALLS):
        begin = time.perf_counter_ns()
        call()
        best = min(best, time.perf_counter_ns() - begin)
    return best / 1e6


def load(name):
    image = cv2.cvtColor(cv2.imread(str(DATA / name)), cv2.COLOR_BGR2RGB)
    return np.ascontiguousarray(np.repeat(image, 316 // image.shape[1], axis=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds per scene (default: 15)")
    rounds = max(1, parser.parse_args().rounds)
    examples = json.loads((DATA / "examples.json").read_text(encoding="utf-8"))
    parameters = from_mapping(DetectorParameters, examples["parameters"]["paper"], where="paper")
    print(f"{'scene':16} {'blocks':>6} {'detector ms':>12} {'usual ms':>9} {'ratio':>6}")
    ratios = []
    for scene, (name, group) in SCENES.items():
        signatures = [Signature.from_mapping(s, where=group) for s in examples["groups"][group]["signatures"]]
        image = load(name)
        detector = BlockDetector(signatures, parameters)
        ranges = hsv_ranges(signatures)
        ours, usual = [], []
        for _ in range(rounds):
            ours.append(fastest_ms(lambda d=detector, i=image: d.detect(i)))
            usual.append(fastest_ms(lambda i=image, r=ranges: usual_pipeline(i, r)))
        mine, theirs = statistics.median(ours), statistics.median(usual)
        ratios.append(theirs / mine)
        print(f"{scene:16} {len(detector.detect(image)):6} {mine:12.3f} {theirs:9.3f} {ratios[-1]:6.1f}")
    print(f"median ratio {statistics.median(ratios):.1f}, smallest {min(ratios):.1f}")
    table = fastest_ms(lambda: ColorTable.of(signatures, parameters))
    print(f"colour table, once per change: {table:.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
