"""What studies take unless told otherwise: nothing but numbers, so that no command's help waits for more."""

#: Bands of `band`, nm: how wide, and where they may lie.
WIDTH_NM, BETWEEN_NM = 50.0, (400.0, 700.0)
#: Electrons of the brightest band in one reading, those that reading it adds, and the spread of gains.
ELECTRONS, READ_NOISE, MISMATCH = 1e6, 100.0, 0.008
#: Farthest distance that `link` asks about, m.
LINK_TO_M = 60.0
#: Noise of one reading over the reading at the first plane, and signal over noise, of `range`.
NOISE, SNR = 0.01, 10.0
#: The paper's rule: what must be left of the light at the first plane.
PAPER_SHARE = 0.2
#: Half of the width that a follower moves in, m.
HALF_WIDTH_M = 0.4
