"""What a user tunes on the camera, with PixyMon's ranges and the camera's defaults."""

from __future__ import annotations

from dataclasses import dataclass

from robot_formation.parameters import ParameterError, parameter

SIGNATURES = 7
"""Signatures that the camera can hold, numbered from 1."""
_RANGE = 3.5


@dataclass(frozen=True)
class DetectorParameters:
    """Parameters of the block detector; each description begins with the parameter's name in PixyMon."""

    signature_range: tuple[float, ...] = parameter(
        (_RANGE,) * SIGNATURES,
        "Signature 1 range to Signature 7 range: gain on the taught chroma interval; missing ones are 3.5",
        low=0.0,
        high=25.0,
    )
    min_brightness: float = parameter(
        0.2, "Min brightness: darkest r+g+b that is looked at, as a fraction of 765", low=0.0, high=0.5
    )
    block_filtering: int = parameter(
        3,
        "Block filtering: steps a block must be seen before it is reported; it is kept half as long after its loss",
        unit="16.4 ms",
        low=0,
        high=60,
    )
    max_merge_dist: int = parameter(
        7, "Max merge dist: gap up to which facing boxes of one signature become one", unit="px", low=0, high=60
    )
    min_block_area: int = parameter(
        20,
        "Min block area: smallest connected component, before merging, in cells of 2 x 1 px",
        unit="cells",
        low=4,
        high=2500,
    )
    signature_teach_threshold: int = parameter(
        3700,
        "Signature teach threshold: chroma distance up to which teaching from a point grows",
        unit="1/32768",
        low=0,
        high=10000,
    )
    max_blocks: int = parameter(100, "Max blocks: boxes kept per frame", low=1, high=100)
    max_blocks_per_signature: int = parameter(
        100, "Max blocks per signature: components looked at per signature, largest first", low=1, high=100
    )
    max_tracking_velocity: int = parameter(
        65, "Max tracking velocity: farther jumps between frames make a new index", unit="px/16.2 ms", low=10, high=320
    )
    color_code_mode: int = parameter(
        1,
        "Color code mode: 0 off, 1 on (code signatures make codes only), 2 codes only, 3 mixed (single boxes are kept)",
        choices=(0, 1, 2, 3),
    )

    led_brightness: int = parameter(
        750,
        "LED brightness: most current of the camera's own lamp; only kept for the camera, since no lamp is simulated",
        unit="uA",
        low=0,
        high=20000,
    )

    def __post_init__(self) -> None:
        """Refuse more ranges than there are signatures."""
        if len(self.signature_range) > SIGNATURES:
            raise ParameterError(f"'signature_range' has {len(self.signature_range)} values; give at most {SIGNATURES}")

    def range_of(self, signature: int) -> float:
        """Range of signature 1..7; the camera's default where the list is shorter."""
        return self.signature_range[signature - 1] if signature <= len(self.signature_range) else _RANGE
