"""What studies and robots take unless told otherwise: nothing but values, so that no command's help waits for
more."""

from typing import Final

#: Bands of `band`, nm: how wide, and where they may lie.
WIDTH_NM, BETWEEN_NM = 50.0, (400.0, 700.0)
#: Electrons of the brightest band in one reading, those that reading it adds, and the spread of gains.
ELECTRONS, READ_NOISE, MISMATCH = 1e6, 100.0, 0.008
#: Farthest distance that `link` asks about, m, and absorption and scattering that it compares with, 1/m.
LINK_TO_M = 60.0
LINK_WATERS = {"clear": (0.05, 0.05), "turbid": (0.05, 0.30)}
#: Noise of one reading over the reading at the first plane, and signal over noise, of `range`.
NOISE, SNR = 0.01, 10.0
#: The paper's rule: what must be left of the light at the first plane.
PAPER_SHARE = 0.2
#: Relative noise of readings that something is hidden in.
HIDDEN_NOISE = 0.005
#: How a model is fitted to readings.
SOLVER: Final = "analytic"
#: Half of the width that a follower moves in, m; what it moves in; poses that count.
HALF_WIDTH_M = 0.4
MEDIUM: Final = "water"
TASK: Final = "formation"
#: An array that is designed: elements, side of their square, m, largest tilt, degrees, least distance, m.
ELEMENTS, BOX_M, TILT_MAX_DEG, SPACING_M = 8, 0.4, 40.0, 0.025
#: Receivers on a side of an array and its side, m, of `range` where a scene has none.
ARRAY_COUNT, ARRAY_SIDE_M = 5, 0.4
#: Waters in which the formula's pose is looked at, 1/m: from none to that of a harbour.
SCATTERING_PER_M = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)
#: Runs of a follower.
RUNS = 4
#: A field for simulators: half of its width, and its step across the beam, m.
FIELD_HALF_WIDTH_M, FIELD_STEP_M = 0.5, 0.1
#: Frame of an array in ROS.
FRAME = "array_link"
