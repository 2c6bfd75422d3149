"""What the paper states in numbers, by figure: the one place that holds these values.

Y. Wang, T. Baba, T. Hikihara, "Robot formation control in nonlinear manifold using Koopman operator theory",
arXiv:2205.04052. Its figures were not available, so what only they show is not here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Statement:
    """A number of the paper.

    Attributes:
        key: by which our value is found.
        says: what the number is of.
        value: the number.
        unit: of the number; may be empty.
        where: in the paper.
        within: by how much another value may differ and still agree, in the unit.
    """

    key: str
    says: str
    value: float
    unit: str
    where: str
    within: float = 0.0


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper: the name of our picture's file, its title, the paper's label for it, and its numbers."""

    name: str
    title: str
    label: str
    statements: tuple[Statement, ...]


_RESULTS, _CAPTION, _SETUP = "section Experimental results", "caption", "section Experimental setups"
_STARTS = {"one": (76.3, 15.8), "one_baseline": (76.9, 17.3), "two": (141.2, 11.1), "two_baseline": (139.7, 16.3)}
_DISTORTION = {"one": 1.3, "one_baseline": 1.7, "two": 1.7, "two_baseline": 2.7}
RUN_WORDS = {
    "one": "track one, with prediction",
    "one_baseline": "track one, without prediction",
    "two": "track two, with prediction",
    "two_baseline": "track two, without prediction",
}
"""The paper's four runs, by the preset that has their start."""

_TRAJECTORIES = (
    *(
        Statement(f"start_{axis}_{track}", f"{RUN_WORDS[track]}: leader starts at {axis}", value, "cm", _CAPTION, 0.05)
        for track, start in _STARTS.items()
        for axis, value in zip("xy", start, strict=True)
    ),
    Statement("step", "the leader's way in a timestep", 5.0, "cm", _RESULTS, 0.1),
    Statement("timesteps_one", "timesteps of track one", 15, "", _RESULTS),
    Statement("timesteps_two", "timesteps of track two", 20, "", _RESULTS),
    *(
        Statement(f"overhead_{track}", f"{word}: largest error of the overhead camera", value, "cm", _CAPTION, 0.5)
        for (track, value), word in zip(_DISTORTION.items(), RUN_WORDS.values(), strict=True)
    ),
    Statement("lost_with", "runs with prediction that lost the leader (both tracks)", 0, "%", _RESULTS),
    Statement("lost_without_two", "track two, without prediction: lost the leader", 100, "%", _RESULTS),
)
_CORRECTIONS = (
    Statement("reduction_two", "track two: less correction distance in total", 78, "%", _RESULTS, 5.0),
    Statement("reduction_two_own", "track two: the same, each method from its own start", 78, "%", _RESULTS, 5.0),
    Statement("worst_timestep", "track one: timestep at which prediction errs noticeably more", 3, "", _RESULTS),
    Statement("reduction_one", "track one: less correction distance (a consistent pattern)", 0, "%", _RESULTS, 5.0),
)
_MOTORS = (
    Statement("range_v", "calibrated distance along v, up to", 20, "cm", "appendix, Movement system", 1.0),
    Statement("range_u", "calibrated distance along u, up to", 10, "cm", "appendix, Movement system", 1.0),
    Statement("curves", "calibration curves (follower v and u, leader v)", 3, "", _CAPTION),
)
_ENCODERS = (
    Statement("pulses", "pulses of a sensing wheel per turn", 512, "", "appendix, Sensing system"),
    Statement("wheel", "diameter of a sensing wheel", 38, "mm", "appendix, Sensing system"),
)
_VISION = "appendix, Visual fine-tuning process"
_AREAS = (
    Statement("grid_reach", "relative positions along u and v, up to", 45, "cm", _VISION),
    Statement("grid_step", "step of the positions", 5, "cm", _VISION),
    Statement("grid_angles", "relative angles, 0 to 60 degrees either way", 9, "", _VISION),
    Statement("areas", "areas (Unattainable, Front, Target, Rear)", 4, "", _VISION),
)
_PAN = (
    Statement("window_px", "width of the fine-tuning window of 6 cm", 50, "px", _CAPTION, 3.0),
    Statement("window_low", "lower end of the fine-tuning window", 110, "px", _CAPTION, 3.0),
    Statement("window_high", "upper end of the fine-tuning window", 160, "px", _CAPTION, 3.0),
    Statement("window_difference", "largest difference in the window over distances u, below", 7, "px", _CAPTION),
)
_SIDE = (
    Statement("tolerance_side", "tolerance of the side lengths' difference", 4, "px", "table 2"),
    Statement("tolerance_v", "tolerance of the position along v", 5, "px", "table 2"),
    Statement("tolerance_u", "tolerance of the position along u", 1.5, "cm", "table 2"),
)
_MANIFOLD = (
    Statement("edge", "edge of the square", 1780, "mm", "caption of the setup's figure"),
    Statement("lowest", "lowest point", 50, "mm", "caption of the setup's figure", 0.1),
    Statement("highest", "highest point", 208.4, "mm", "caption of the setup's figure", 0.1),
)
_ILLUSTRATION = (
    Statement("distance", "distance of the robots in formation", 32, "cm", _RESULTS, 0.05),
    Statement("body_length", "length of a robot", 365, "mm", "appendix, Design of robot"),
    Statement("body_width", "width of a robot", 238, "mm", "appendix, Design of robot"),
    Statement("body_height", "height of a robot", 216, "mm", "appendix, Design of robot"),
    Statement("mass", "mass of a robot", 1700, "g", "appendix, Design of robot"),
)
_SCHEME = (Statement("collection", "timesteps of the data collection phase", 3, "", _SETUP),)
_FLOW = (
    Statement("signature_target", "signature range of Target", 5.0, "", "table 1"),
    Statement("signature_front", "signature range of Front", 6.0, "", "table 1"),
    Statement("signature_rear", "signature range of Rear", 6.0, "", "table 1"),
    Statement("block_filtering", "block filtering", 40, "", "table 1"),
    Statement("max_merge_dist", "max merge distance", 4, "", "table 1"),
    Statement("min_block_area", "min block area", 20, "", "table 1"),
    Statement("frame_rate", "least frames per second", 30, "", "table 1"),
)

FIGURES = (
    PaperFigure("trajectories", "Trajectories over contour lines", "traj_result", _TRAJECTORIES),
    PaperFigure("corrections", "Correction distance per timestep and axis", "algo_compare", _CORRECTIONS),
    PaperFigure("motors", "Motor calibration curves", "motor calibration", _MOTORS),
    PaperFigure("encoders", "Accuracy of the sensing wheels", "encoder_accu", _ENCODERS),
    PaperFigure("vision_areas", "Areas around the beacon neighbour", "overlay_pixy2", _AREAS),
    PaperFigure("vision_pan", "Position of the Target block against v", "pixy_pan", _PAN),
    PaperFigure("vision_side", "Side length of the Target block against u", "pixy_side", _SIDE),
    PaperFigure("manifold", "The manifold", "potential_view", _MANIFOLD),
    PaperFigure("illustration", "Leader and follower from above", "velocity_compare, 2d_illustration", _ILLUSTRATION),
    PaperFigure("scheme", "The follower's algorithm", "algorithm_scheme", _SCHEME),
    PaperFigure("visual_flow", "The visual algorithm", "visual_algo_flow", _FLOW),
)
