"""Sound inputs of every kind, from which the wrong ones are made."""

from __future__ import annotations

import math

SCENE = """name = "tank"
[lamp]
profile = "gaussian"
hwhm_deg = 3.81
power_w = 50.0
temperature_k = 2900.0
[water]
base = "none"
absorption_per_m = 0.045
scattering_per_m = 0.0
phase = { type = "henyey-greenstein", g = 0.924 }
[tank]
width_m = 3.66
depth_m = 2.44
length_m = 36.6
wall_albedo = 0.0
surface = "none"
[detector]
quantity = "irradiance"
planes_m = [4.5, 6.5, 8.5]
width_m = 1.0
pixels = 9
bands_nm = [[500.0, 550.0]]
"""
#: What a scene may say beside that; a part of it joins the others in a case.
MORE = (
    '[lamp]\nprofile = "super-gaussian"\nshape_exponent = 3.0',
    '[lamp]\nprofile = "two-component"\nskirt_fraction = 0.1\nskirt_hwhm_deg = 12.0',
    "[lamp]\noffset_x_m = 0.1\ntilt_x_deg = 1.0\nellipticity = 1.2\napparent_distance_m = 0.3",
    '[lamp]\nspectrum = "cie-a"\ndrift_per_hour = 0.1\nwarmup_fraction = 0.1\nwarmup_time_s = 100.0',
    '[water]\nbase = "pure"\nchlorophyll_mg_per_m3 = 1.0\ncdom_440_per_m = 0.1\nsediment_g_per_m3 = 1.0',
    '[water]\nbase = "petzold-coastal"\nphase = { type = "petzold", water = "coastal" }',
    '[water]\nscattering_per_m = 0.1\nphase = { type = "fournier-forand", n = 1.1, mu = 3.5 }',
    '[water]\nabsorption_at = [[500.0, 0.03], [550.0, 0.05]]\nphase = { type = "two-term-hg" }',
    "[water]\ngradient_per_m2 = 0.001\nlayer_absorption_per_m = 0.1\nlayer_width_m = 0.5",
    '[tank]\nwall_albedo = 0.3\nsurface = "flat"\nfloor_over_walls = 2.0\nsurface_slope_deg = 3.0',
    '[detector]\nquantity = "radiance"\nfull_angle_deg = 5.0\naim = "axis"',
    "[detector]\npositions_m = [[0.0, 0.0, 4.5], [0.1, 0.0, 4.5]]",
    "[lamp]\nprofile_departure = [[0.0, 0.1], [5.0, -0.2]]\npower_departure = [[0.0, 0.0], [60.0, 0.1]]",
    "[water]\nabsorption_departure = [[4.0, 0.01], [7.0, 0.0]]\ncolour_departure = [[450.0, 0.01]]",
    "[lamp]\nspectrum_departure = [[450.0, 0.1], [600.0, -0.1]]\n[detector]\nplane_departure = [[4.5, 0.01]]",
    "[array]\nradius_m = 0.5\ncount = [3, 3]\nadc_bits = 8\n[follower]\nx_m = 0.1\nyaw_deg = 5.0",
    '[array]\nradius_m = 0.5\nsample_hz = 200.0\n[follower.mission]\ntask = "dock"\nlaw = "lqr"\n'
    "duration_s = 0.5\ndark_for_s = 0.1\nturbid_factor = 2.0\ncurrent_x_m_per_s = 0.1",
    "[detector]\nbackground = 0.1\nsaturation = 0.1\nbands_nm = [[450.0, 500.0], [500.0, 550.0]]",
)
#: An effect of the user's own, in a file of its own.
OWN = """[[effect]]
name = "rope"
stage = "path"
formula = "1 - depth*exp(-((x - x0)/0.1)**2)*where(z > 1, 1, min(r, 2))"
[effect.parameters]
depth = { unit = "1", range = [0.0, 0.9], neutral = 0.0, typical = 0.05 }
x0 = { unit = "m", range = [-0.5, 0.5], meaning = "where it hangs" }
"""
TABLES = {
    "beam.csv": "# a beam\nangle_deg,intensity\n0,1000\n2,800\n5,300\n10,10\n45,0\n",
    "lamp.csv": "wavelength_nm,power\n400,0.1\n500,0.5\n600,1.0\n",
    "water.csv": "wavelength_nm,absorption_per_m,scattering_per_m\n400,0.1,0.2\n500,0.05,0.15\n600,0.3,0.1\n",
    "phase.csv": "angle_deg,phase_per_sr\n0.1,1000\n1,100\n10,1\n90,0.01\n180,0.02\n",
    "beam.ies": "IESNA:LM-63-2002\n[TEST] 1\nTILT=NONE\n1 1000 1.5 5 2 1 2 0 0 0\n1 1 50\n"
    "0 5 10 45 90\n0 90\n"
    "1000 800 300 10 0\n1000 600 100 10 0\n",
    "beam.ldt": "maker 1 1 1 0 5 0 x x x x x 0 0 0 0 0 0 0 0 0 0 0 0 0 1 1 spot 1 1 2900 80 50 "
    "1 1 1 1 1 1 1 1 1 0 0 5 10 45 90 1000 800 300 10 0 ".replace(" ", "\n"),
}
NAMED_BY = {
    "beam.csv": '[lamp]\nprofile = "table"\nintensity_table = "beam.csv"\n',
    "beam.ies": '[lamp]\nprofile = "table"\nintensity_table = "beam.ies"\n',
    "beam.ldt": '[lamp]\nprofile = "table"\nintensity_table = "beam.ldt"\n',
    "lamp.csv": '[lamp]\nspectrum = "table"\nspectrum_table = "lamp.csv"\n',
    "water.csv": '[water]\nbase = "table"\ntable = "water.csv"\n',
    "phase.csv": '[water]\nscattering_per_m = 0.1\nphase = { type = "table", file = "phase.csv" }\n',
}
_PLACES = [(x, z) for z in (4.5, 5.5, 6.5, 7.5, 8.5) for x in (-0.2, -0.1, 0.0, 0.1, 0.2)]
_VALUES = [
    math.exp(-0.05 * z - (math.atan(x / z) / 0.08) ** 2) / z**2 * (1 + 0.004 * math.sin(9 * n))
    for n, (x, z) in enumerate(_PLACES)
]
READINGS = """# quantity = "irradiance"
# scale = "relative"
# plane_gain_percent = 0.2
# position_mm = 1.0
## a free comment
medium,x_m,y_m,z_m,wavelength_nm,value,stderr,time_s,integration_time_s
""" + "".join(
    f"water,{x},0.0,{z},525,{value:.6g},0.0001,{n * 10},0.1\n"
    for n, ((x, z), value) in enumerate(zip(_PLACES, _VALUES, strict=True))
)
PLAN = """[settings]
rel_error = 0.5
max_photons = 1e5
seed = 3
[[vary]]
path = "water.absorption_per_m"
start = 0.0
stop = 0.5
count = 5
[[vary]]
path = "tank.wall_albedo"
values = [0.0, 0.2, 0.4]
[[vary]]
name = "beam"
together = { "lamp.hwhm_deg" = [3.0, 4.0], "lamp.power_w" = [40.0, 60.0] }
"""
INDEX = """file,medium,x_m,y_m,z_m,time_s,role,integration_time_s
suite.txt,water,0.0,0.0,4.5,0,signal,0.07
view.txt,water,0.1,0.0,4.5,10,signal,0.07
jaz.txt,water,0.0,0.0,5.5,20,signal,0.07
watts.txt,water,0.0,0.0,6.5,30,ignore,0.07
dark.txt,,,,,0,dark,0.07
avantes.ttt,water,0.2,0.0,5.5,40,signal,0.07
table.csv,water,0.3,0.0,5.5,50,signal,0.07
"""
OTHERS = """file,z_m,spectrum
cast.sb,4.5,
ramses.dat,5.5,
"""
LOGGERS = "file,z_m\npar.dat,4.5\n"


def _rows(*columns: list[float]) -> str:
    return "".join("\t".join(f"{cell:.3f}" for cell in row) + "\n" for row in zip(*columns, strict=True))


_NM = [490 + 1.5 * k for k in range(50)]
_LIGHT = [1200 + 900 * math.exp(-(((w - 515) / 16) ** 2)) for w in _NM]
_DARK = [1150 + 3 * math.sin(w) for w in _NM]
_HEAD = """SpectraSuite Data File
++++++++++++++++++++++++++++++++++++
Date: Tue Mar 03 11:12:13 CET 2020
Spectrometers: TEST1
Integration Time (usec): 70000 (TEST1)
Spectra Averaged: 15 (TEST1)
Boxcar Smoothing: 5 (TEST1)
Correct for Electrical Dark: No (TEST1)
Correct for Detector Non-linearity: Yes (TEST1)
Number of Pixels in Processed Spectrum: 50
>>>>>Begin Processed Spectral Data<<<<<
"""
_END = ">>>>>End Processed Spectral Data<<<<<\n"
SPECTRA = {
    "suite.txt": _HEAD + _rows(_NM, _LIGHT) + _END,
    "dark.txt": _HEAD + _rows(_NM, _DARK) + _END,
    "view.txt": "Data from a Node\n\nDate: Tue Mar 03 11:12:13 CET 2020\nSpectrometer: TEST1\n"
    "Integration Time (sec): 7.000000E-2\nScans to average: 15\nBoxcar width: 5\n"
    ">>>>>Begin Spectral Data<<<<<\n" + _rows(_NM, _LIGHT),
    "jaz.txt": _HEAD.replace("SpectraSuite", "Jaz") + "W\tD\tS\n" + _rows(_NM, _DARK, _LIGHT) + _END,
    "avantes.ttt": "TEST1-\nIntegration time: 70.00 ms\nAverage: 15 scans\n"
    "Nr of pixels used for smoothing: 5\nData measured with spectrometer name: TEST1\n"
    "Wave   ;Dark     ;Sample\n[nm]   ;[counts] ;[counts]\n" + _rows(_NM, _DARK, _LIGHT).replace("\t", ";"),
    "table.csv": "wavelength_nm,counts\n" + _rows(_NM, _LIGHT).replace("\t", ","),
    "cast.sb": "/begin_header\n/missing=-999\n/delimiter=comma\n/fields=date,time," + ",".join(
        f"Ed{w}" for w in _NM) + "\n/units=yyyymmdd,hh:mm:ss" + ",uW/cm^2/nm" * 50
    + "\n/end_header\n20200303,11:12:13," + ",".join(f"{c:.3f}" for c in _LIGHT) + "\n",
    "ramses.dat": "[Spectrum]\nIDDevice = SAM_8166\nIDDataTypeSub1 = CALIBRATED\nIntegrationTime = 70\n"
    "Unit2 = $03 $05 mW/(m^2 nm)\n[Data]\n0 70 0 0\n" + _rows(_NM, _LIGHT).replace("\t", " ")
    + "[END] of [Data]\n[END] of [Spectrum]\n",
    "par.dat": "time,PAR (umol)\n2020-01-01 00:00:00,100\n2020-01-01 00:00:10,102\n",
    "watts.txt": _HEAD.replace("SpectraSuite Data", "Jaz Absolute Irradiance") + "W\tD\tS\tP\n"
    + _rows(_NM, _DARK, _LIGHT, _LIGHT) + _END + ">>>>>Begin Calibration Data<<<<<\n[uJoule/count]\n"
    + "".join(f"{1e-6 * w:.8e}\n" for w in _NM) + ">>>>>End Calibration Data<<<<<\n",
}  # fmt: skip
