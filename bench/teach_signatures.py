"""Teaches the signatures of config/signatures.yaml from the world's marker, as a user does with "Set signature".

Each face is seen squarely in formation by a camera that has just been switched on; the rectangle lies inside the face.

Run: python bench/teach_signatures.py [--out FILE]
"""

import argparse
import sys
from pathlib import Path

from robot_formation.components.node_parameters import WorldNodeParameters
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.parameters import from_mapping
from robot_formation.paths import config_dir
from robot_formation.vision.pixy2.signatures import save_signatures, teach_region
from robot_formation.world.marker_picture import marker_picture

FACES = ("target", "front", "rear")
REGION = (136, 32, 44, 44)
"""Column, row, width and height, px."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = config_dir() / "signatures.yaml"
    parser.add_argument("--out", type=Path, default=default, help="file to write (default: config/signatures.yaml)")
    out = parser.parse_args().out
    world = from_mapping(WorldNodeParameters, node_defaults("world"), where="config/world.yaml")
    taught = [teach_region(marker_picture(world, face), REGION, sig) for sig, face in enumerate(FACES, 1)]
    save_signatures(out, taught)
    for signature in taught:
        print(signature)
    return 0


if __name__ == "__main__":
    sys.exit(main())
