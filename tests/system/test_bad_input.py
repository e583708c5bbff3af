"""Wrong files, options and places: each gives one line that says what, where and what to do, and exit code 2.

The table calls the program in this process; what depends on the process (environment, rights, disks) runs it
for real. No case may trace: all of this is found before any work.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from lightfield import cli
from lightfield.commands._line import available

ROOT = Path(__file__).resolve().parents[2]
TANK = '[water]\nabsorption_per_m = 0.1\n[tank]\nsurface = "none"\n'
SWEEP = "sweep scene.toml --dry-run --vary water.absorption_per_m"
FIVE = "4.5,1\n5.5,0.6\n6.5,0.4\n7.5,0.3\n8.5,0.2\n"

# Files by name. `folder` is a folder, `taken` a file where a folder is wanted.
FILES: dict[str, str | bytes] = {
    "scene.toml": TANK,
    "array.toml": "[array]\n",
    "open.toml": "[water]\nabsorption_per_m = 0.1\n",
    "places.toml": "[detector]\npositions_m = [[0, 0, 4.5], [0.1, 0, 4.5]]\n",
    "readings.csv": f"z_m,value\n{FIVE}",
    "taken": "a file\n",
    "empty.toml": "",
    "comment.toml": "# nothing yet\n",
    "binary.toml": bytes(range(256)),
    "garbage.json": '{"format": "lightfield session 1", "states": []}',
    "nul.toml": b"[lamp]\x00\n",
    "utf16.toml": "[lamp]\nhwhm_deg = 3\n".encode("utf-16"),
    "broken.toml": "[lamp\nhwhm_deg = 3\n",
    "radians.toml": "[lamp]\nhwhm_rad = 0.07\n",
    "misspelt.toml": "[water]\nscatering_per_m = 0.1\n",
    "section.toml": "[watr]\nabsorption_per_m = 0.1\n",
    "huge.toml": "[lamp]\npower_w = 1e400\n",
    "nan.toml": "[lamp]\nhwhm_deg = nan\n",
    "negative.toml": "[water]\nabsorption_per_m = -0.1\n",
    "long.toml": "[tank]\nlength_m = 1e30\n",
    "pixels.toml": "[detector]\npixels = 1000000\n",
    "outside.toml": "[tank]\nlength_m = 6\n",
    "table.toml": '[lamp]\nprofile = "table"\nintensity_table = "folder"\n',
    "own.toml": '[[effect]]\nname = "rope"\nstage = "path"\nformula = "1 - a*x.real"\n'
    "[effect.parameters]\na = { range = [0.0, 1.0], neutral = 0.0 }\n",
    "garbage.nc": os.urandom(500),
    "other.nc": b"CDF\x01" + bytes(28),  # a valid NetCDF-3 file without content
    "empty.csv": "",
    "random.csv": b"\x00\x01\x02" * 100,
    "header.csv": "z_m,value\n",
    "millimetres.csv": "z_mm,value\n4500,1\n",
    "nan.csv": "z_m,value\n4.5,nan\n5.5,1\n",
    "text.csv": "z_m,value\n4.5,bright\n",
    "stderr.csv": "z_m,value,stderr\n4.5,1,-1\n",
    "head.csv": f"# quantity = irradiance\nz_m,value\n{FIVE}",
    "radiance.csv": f'# quantity = "radiance"\nz_m,value\n{FIVE}',
    "far.csv": "z_m,value\n1e9,1\n",
    "one.csv": "z_m,value\n4.5,1\n",
    "unplaced.csv": "x_m\n0.1\n",
    "index.csv": "file,z_m\nno.txt,4.5\n",
    "plan.toml": "[[vary]]\npath = 'water.absorption_per_m'\n",
    "settings.toml": "[settings]\nrel_eror = 0.1\n[[vary]]\npath = 'tank.wall_albedo'\nvalues = [0.1]\n",
    "torn.zarr/.zmetadata": "{",
}
ASKED = "--quantity irradiance --units counts --band 500:550 -o out.csv"

# Command line, and words that its message has to hold.
WRONG: list[tuple[str, list[str]]] = [
    # the program
    ("rendr scene.toml", ["invalid choice: 'rendr'"]),
    ("render", ["required: SCENE"]),
    ("render scene.toml --frobnicate", ["--frobnicate"]),
    ("render scene.toml more", ["more"]),
    ("render scene.toml --threads 0", ["--threads", "1 to 1024"]),
    ("render scene.toml --backend gpu", ["--backend", "'gpu'", "llvm"]),
    # scene files
    ("render no.toml", ["no.toml", "No such file"]),
    ("render folder", ["folder", "Is a directory"]),
    ("render empty.toml", ["empty.toml", "says nothing", "[lamp]"]),
    ("render comment.toml", ["comment.toml", "says nothing"]),
    ("render binary.toml", ["binary.toml", "not a text file", "UTF-8"]),
    ("render nul.toml", ["nul.toml", "not TOML", "line 1"]),
    ("render utf16.toml", ["utf16.toml", "UTF-8"]),
    ("render broken.toml", ["broken.toml", "not TOML", "line 1"]),
    ("render radians.toml", ["lamp.hwhm_rad", "did you mean lamp.hwhm_deg"]),
    ("render misspelt.toml", ["water.scatering_per_m", "did you mean water.scattering_per_m?"]),
    ("render section.toml", ["watr", "did you mean water?"]),
    ("render huge.toml", ["lamp.power_w", "found inf", "1e+06 (W)"]),
    ("render nan.toml", ["lamp.hwhm_deg", "found nan"]),
    ("render negative.toml", ["water.absorption_per_m", "found -0.1", ">= 0"]),
    ("render long.toml", ["tank.length_m", "100000 (m)"]),
    ("render pixels.toml", ["detector.pixels", "4096"]),
    ("render outside.toml", ["[0, 0, 6.5]", "outside the tank"]),
    ("render table.toml", ["lamp.intensity_table", "folder"]),
    # options of a render
    ("render scene.toml --rel-error 0", ["found 0.0", "1e-5 to 1"]),
    ("render scene.toml --rel-error nan", ["found nan"]),
    ("render scene.toml --rel-error small", ["--rel-error", "'small'"]),
    ("render scene.toml --max-photons -5", ["photon", "found -5"]),
    ("render scene.toml --max-photons inf", ["photon", "found inf"]),
    ("render scene.toml --seed -1", ["--seed", "0 to"]),
    ("render scene.toml --seed 99999999999999999999", ["--seed", "0 to"]),
    ("render scene.toml --seed 1.5", ["--seed", "'1.5'"]),
    ("render scene.toml --wavelengths red", ["--wavelengths", "500,525,550"]),
    ("render scene.toml --wavelengths 600,500", ["--wavelengths", "rising"]),
    ("render scene.toml --wavelengths 500:600:0", ["--wavelengths"]),
    ("render scene.toml --wavelengths 500:600:1e-9", ["--wavelengths", "at most 2000"]),
    ("render scene.toml --wavelengths 1e30", ["--wavelengths", "200 to 2000"]),
    # where the result goes
    ("render scene.toml -o taken", ["taken", "cannot write here"]),
    ("render scene.toml -o taken/sub", ["taken/sub", "cannot write here"]),
    ("render scene.toml -o /proc/nowhere", ["/proc/nowhere", "cannot write here"]),
    # compare a scene, maps
    ("compare no.toml", ["no.toml", "No such file"]),
    ("compare scene.toml -o taken", ["taken", "cannot write here"]),
    ("compare places.toml", ["places.toml", "planes_m"]),
    ("compare no.nc", ["no.nc", "cannot read"]),
    ("compare garbage.nc", ["garbage.nc", "cannot read"]),
    ("compare other.nc", ["other.nc", "not a rendering"]),
    ("compare other.nc --max-photons 1e5", ["other.nc", "as they are", "leave them out"]),
    ("compare other.nc --solver render", ["other.nc", "nothing is fitted", "--scene"]),
    ("compare scene.toml --with background", ["scene.toml", "nothing is fitted", "--scene scene.toml"]),
    # compare readings
    ("compare readings.csv", ["readings.csv", "--scene"]),
    ("compare no.csv --scene scene.toml", ["no.csv", "No such file"]),
    ("compare folder --scene scene.toml", ["folder", "Is a directory"]),
    ("compare readings.csv --scene readings.csv", ["readings.csv", "not TOML"]),
    ("compare empty.csv --scene scene.toml", ["empty.csv", "empty"]),
    ("compare random.csv --scene scene.toml", ["random.csv", "not a text file"]),
    ("compare header.csv --scene scene.toml", ["header.csv", "no reading"]),
    ("compare millimetres.csv --scene scene.toml", ["line 1", "z_m is missing", "'z_mm' to z_m, in metres"]),
    ("compare nan.csv --scene scene.toml", ["nan.csv", "line 2", "'nan'"]),
    ("compare text.csv --scene scene.toml", ["text.csv", "line 2", "'bright'"]),
    ("compare stderr.csv --scene scene.toml", ["line 2", "stderr", "-1"]),
    ("compare head.csv --scene scene.toml", ["line 1", "not TOML"]),
    ("compare radiance.csv --scene scene.toml", ["another quantity", "'radiance'"]),
    ("compare far.csv --scene scene.toml", ["line 2", "positions in metres"]),
    ("compare readings.csv --scene scene.toml --with scatering", ["did you mean scattering?"]),
    ("compare readings.csv --scene scene.toml --with saturation:cubic", ["'cubic'", "hyperbolic"]),
    ("compare readings.csv --scene scene.toml --solver magic", ["--solver", "render"]),
    ("compare readings.csv --scene scene.toml --max-photons 1e5", ["--max-photons", "--solver render"]),
    ("compare readings.csv --scene scene.toml --fit-json taken/x.json", ["taken", "cannot write here"]),
    ("compare readings.csv --scene scene.toml -o taken", ["taken", "cannot write here"]),
    # scene
    ("scene", ["no scene file", "lightfield scene FILE"]),
    ("scene no.toml", ["no.toml", "No such file"]),
    ("scene scene.toml --get water.scatering_per_m", ["did you mean water.scattering_per_m?"]),
    ("scene scene.toml --get ''", ["no such parameter"]),
    ("scene scene.toml --set water.absorption_per_m", ["--set", "PATH=VALUE"]),
    ("scene scene.toml --set water.absorption_per_m=-1", ["water.absorption_per_m", "found -1"]),
    ("scene scene.toml --set water.absorption_per_m=clear", ["'clear'", "a number"]),
    ("scene scene.toml --set lamp=3", ["lamp", "[lamp]"]),
    ("scene open.toml --set tank.wall_albedo=0.1", ["no tank", "[tank]"]),
    ("scene scene.toml --to-xml folder", ["folder", "a file"]),
    ("scene scene.toml --to-xml scene.toml", ["scene.toml", "in use"]),
    ("scene scene.toml --to-toml --get water", ["not allowed with"]),
    # picture
    ("picture no.toml", ["no.toml", "No such file"]),
    ("picture scene.toml --size large", ["--size", "WIDTHxHEIGHT"]),
    ("picture scene.toml --size 0x0", ["--size", "16"]),
    ("picture scene.toml --samples 0", ["--samples", "2 to"]),
    ("picture scene.toml -o picture.jpg", ["picture.jpg", ".png"]),
    ("picture scene.toml -o taken/picture.png", ["taken", "cannot write here"]),
    # explore
    ("explore", ["required: SCENE|SESSION"]),
    ("explore no.toml", ["no.toml", "No such file"]),
    ("explore misspelt.toml", ["water.scatering_per_m", "did you mean"]),
    ("explore scene.toml no.csv", ["no.csv", "No such file"]),
    ("explore scene.toml nan.csv", ["nan.csv", "line 2", "'nan'"]),
    ("explore no.json", ["no.json", "No such file"]),
    ("explore garbage.json", ["garbage.json", "not a session"]),
    ("explore garbage.json readings.csv", ["garbage.json", "a session has its own readings"]),
    ("explore scene.toml --no-browser --effects-file no.toml", ["no.toml", "No such file"]),
    # regime
    ("regime no.toml", ["no.toml", "No such file"]),
    ("regime scene.toml -o taken", ["taken", "cannot write here"]),
    ("regime scene.toml --rel-error zero", ["--rel-error", "'zero'"]),
    ("regime scene.toml --seed -1", ["--seed", "0 to"]),
    # import
    ("import", ["required: INDEX.csv"]),
    ("import index.csv --quantity irradiance", ["-o READINGS.csv"]),
    ("import index.csv -o out.csv", ["quantity", "units", "bands"]),
    (f"import no.csv {ASKED}", ["no.csv", "No such file"]),
    (f"import folder {ASKED}", ["folder", "Is a directory"]),
    (f"import readings.csv {ASKED}", ["line 1", "the column file is missing"]),
    (f"import index.csv {ASKED}", ["line 2", "no.txt"]),
    (f"import index.csv {ASKED} --units furlongs", ["'furlongs'", "unit"]),
    (f"import index.csv {ASKED} --band nan:nan", ["nan", "band"]),
    (f"import index.csv {ASKED} --saturation-level -1", ["saturation level", "> 0"]),
    (f"import index.csv {ASKED} -o taken/out.csv", ["taken", "cannot write here"]),
    # new
    ("new tank", ["required: -o"]),
    ("new ship -o out", ["tank"]),
    ("new tank --tank 2x1 -o out", ["tank: not the sizes of a tank", "WxDxL"]),
    ("new tank --tank 2xAx6 -o out", ["tank: not understood", "WxDxL"]),
    ("new tank --tank 2x1x6 --planes 7 -o out", ["[0, 0, 7] is outside the tank"]),
    ("new tank --tank 2x1x6 --lamp-depth 2 -o out", ["lamp_depth_m must be less than depth_m"]),
    ("new tank --lamp pink -o out", ["lamp: not a spectrum", "led-green"]),
    ("new tank --lamp 525/wide -o out", ["lamp: not understood", "PEAK/WIDTH"]),
    ("new tank --water muddy -o out", ["water: not a water", "petzold-harbor"]),
    ("new tank --surface maybe -o out", ["surface: neither yes nor no"]),
    ("new tank --points 0 -o out", ["points: impossible number"]),
    ("new tank --band 500 -o out", ["band: not a band"]),
    ("new tank --quantity light -o out", ["detector.quantity", "'irradiance'"]),
    ("completion tea", ["invalid choice: 'tea'"]),
    # hide
    ("hide scene.toml", ["required: -o"]),
    ("hide no.toml -o out", ["no.toml", "No such file"]),
    ("hide scene.toml --effect scatering -o out", ["did you mean scattering?"]),
    ("hide scene.toml --effect background --effect background -o out", ["--effect", "twice"]),
    ("hide open.toml --effect wall_reflection -o out", ["wall_reflection", "no [tank]"]),
    ("hide scene.toml --effect background --size detector.backgrond=1 -o out", ["detector.background"]),
    ("hide scene.toml --effect background --size tank.wall_albedo=0.2 -o out", ["hide wall_reflection too"]),
    ("hide scene.toml --effect background --size detector.background=dark -o out", ["--size", "PATH=NUMBER"]),
    ("hide scene.toml --noise nan -o out", ["--noise", "0.5"]),
    ("hide scene.toml --layout spiral -o out", ["'spiral'", "line"]),
    ("hide scene.toml --strength 0 -o out", ["--strength", "above 0"]),
    ("hide scene.toml --max-photons 0 -o out", ["photon"]),
    ("hide scene.toml -o taken", ["taken", "cannot write here"]),
    ("hide scene.toml --effect beam_profile -o out", ["beam_profile", "true lamp's table"]),
    ("hide scene.toml --lamp no.csv -o out", ["no.csv", "no such file"]),
    ("hide scene.toml --effects-file own.toml -o out", ["own.toml", "a formula holds something else"]),
    # effects of one's own
    ("diagnose readings.csv --scene scene.toml --effects-file no.toml", ["no.toml", "No such file"]),
    ("diagnose readings.csv --scene scene.toml --effects-file own.toml", ["own.toml", "Attribute"]),
    ("diagnose readings.csv --scene scene.toml --effects-file open.toml", ["open.toml", "[[effect]]"]),
    ("plan readings.csv --scene scene.toml --effects-file own.toml", ["own.toml", "Attribute"]),
    ("compare readings.csv --scene scene.toml --effects-file own.toml", ["own.toml", "Attribute"]),
    # diagnose
    ("diagnose", ["readings and a scene", "--scene SCENE"]),
    ("diagnose readings.csv", ["--scene SCENE"]),
    ("diagnose readings.csv --scene no.toml", ["no.toml", "No such file"]),
    ("diagnose no.csv --scene scene.toml", ["no.csv", "No such file"]),
    ("diagnose far.csv --scene scene.toml --no-trace", ["line 2", "positions in metres"]),
    ("diagnose one.csv --scene scene.toml --no-trace", ["one.csv", "too few readings"]),
    ("diagnose readings.csv --scene scene.toml --effects magic", ["'magic'", "background"]),
    ("diagnose readings.csv --scene scene.toml --effects ,", ["--effects", "no effect is named"]),
    ("diagnose readings.csv --scene scene.toml --alpha nan", ["--alpha", "0.5"]),
    ("diagnose readings.csv --scene scene.toml --seed -1", ["--seed", "0 to"]),
    ("diagnose readings.csv --scene scene.toml --json folder", ["folder", "a file"]),
    ("diagnose readings.csv --scene scene.toml --report taken/r.html", ["taken", "cannot write here"]),
    ("diagnose readings.csv --scene scene.toml -o taken", ["taken", "cannot write here"]),
    # plan
    ("array show scene.toml", ["no array", "add the table [array]"]),
    ("array compare array.toml --with open.toml --report open.toml --no-trace", ["open.toml", "in use"]),
    ("array show array.toml --half-width -1 --no-trace", ["--half-width", "above 0 to 100 m"]),
    ("array show array.toml --max-photons 1", ["--max-photons", "1e3 to 1e12"]),
    ("array show array.toml --report folder --no-trace", ["folder", "a file"]),
    ("array", ["required: TASK"]),
    ("array compare array.toml --with scene.toml --no-trace", ["no array"]),
    ("array compare array.toml", ["required: --with"]),
    ("array optimise array.toml --elements 0 --no-trace", ["--elements", "2 to 200"]),
    ("array optimise array.toml --elements 100 --no-trace", ["100 elements do not fit", "7 x 7 places"]),
    ("array optimise array.toml --box nan --no-trace", ["--box", "0.01 to 10"]),
    ("pose estimate readings.csv array.toml --no-trace", ["readings.csv", "column e1 is missing"]),
    ("pose estimate no.csv array.toml --no-trace", ["no.csv", "No such file"]),
    ("pose estimate readings.csv scene.toml --no-trace", ["no array"]),
    ("pose bias array.toml --scattering a,b --no-trace", ["--scattering", "0 to 10"]),
    ("pose bias array.toml --json array.toml --no-trace", ["array.toml"]),
    ("follow scene.toml --no-trace", ["no array", "add the table [array]"]),
    ("follow array.toml --no-trace --runs 0", ["--runs", "1 to 200"]),
    ("follow array.toml --no-trace --believe hope", ["--believe", "hope", "field, fitted"]),
    ("follow array.toml --no-trace --duration -1", ["duration_s", "a number > 0"]),
    ("follow array.toml --no-trace --duration 3600 --runs 200", ["too many readings", "at most 300000"]),
    ("follow array.toml --no-trace --vary water.scattering_per_m=0,0.1", ["a store", "-o STORE.zarr"]),
    ("follow array.toml --no-trace -o runs.zarr", ["what varies", "--vary PATH=RANGE"]),
    ("follow array.toml --no-trace --vary water.colour=1,2 -o r.zarr", ["water.colour", "no such parameter"]),
    ("follow array.toml --no-trace --report folder", ["folder", "a file"]),
    ("follow array.toml --with no.toml", ["no.toml", "No such file"]),
    ("follow array.toml --no-trace --with array.toml", ["array.toml", "two scenes of one name"]),
    ("plan readings.csv", ["required: --scene"]),
    ("plan no.csv --scene scene.toml", ["no.csv", "No such file"]),
    ("plan millimetres.csv --scene scene.toml", ["line 1", "rename 'z_mm' to z_m, in metres"]),
    ("plan unplaced.csv --scene scene.toml", ["lightfield: unplaced.csv: ", "line 1", "z_m is missing"]),
    ("plan far.csv --scene scene.toml --no-trace", ["line 2", "positions in metres"]),
    ("plan readings.csv --scene scene.toml --json folder", ["folder", "a file"]),
    # range
    ("range no.toml", ["no.toml", "No such file"]),
    ("range open.toml --no-trace --share 2", ["impossible share", "found 2.0"]),
    ("range open.toml --no-trace --array 1", ["impossible array"]),
    ("range open.toml --no-trace --to 3", ["no distances to compare", "4.5 to 3 m"]),
    ("range open.toml --no-trace --readings far.csv", ["far.csv", "positions in metres"]),
    # link
    ("field export no.toml -o f.nc", ["no.toml", "No such file"]),
    ("field export open.toml -o f.nc --no-trace --step 9", ["impossible grid", "steps of 9 m"]),
    ("field export open.toml -o f.nc --no-trace --step 1e-5", ["too many places"]),
    ("field export open.toml -o open.toml --no-trace", ["open.toml"]),
    ("field export open.toml", ["required: -o"]),
    ("ros open.toml --no-trace", ["no array"]),
    ("link no.toml", ["no.toml", "No such file"]),
    ("link open.toml --ber 2", ["impossible ber", "found 2.0"]),
    ("link open.toml --area 0", ["impossible area_mm2"]),
    ("link open.toml --water ice", ["--water", "'ice'", "NAME=A,B"]),
    ("link open.toml --to 1", ["impossible distances", "4 to 1 m"]),
    ("link open.toml --json open.toml", ["open.toml"]),
    # band
    ("band no.toml", ["no.toml", "No such file"]),
    ("band open.toml --no-trace --between 500", ["--between", "LOW:HIGH"]),
    ("band open.toml --no-trace --distances far", ["--distances", "'far'"]),
    ("band open.toml --no-trace --width 1000", ["impossible bands"]),
    ("band open.toml --no-trace --response readings.csv", ["readings.csv", "wavelength_nm, response"]),
    ("band open.toml --no-trace --response no.csv", ["no.csv", "No such file"]),
    # attenuation
    ("attenuation readings.csv", ["required: --scene"]),
    ("attenuation no.csv --scene scene.toml", ["no.csv", "No such file"]),
    ("attenuation readings.csv --scene scene.toml --air", ["readings.csv", "no readings in air"]),
    ("attenuation readings.csv --scene scene.toml --air --no-air", ["not allowed with"]),
    ("attenuation one.csv --scene scene.toml", ["one.csv", "several distances", "found '1 with readings"]),
    ("attenuation radiance.csv --scene scene.toml", ["another quantity"]),
    (
        "attenuation readings.csv readings.csv readings.csv --scene scene.toml --scene open.toml",
        ["--scene", "3 tables, 2 scenes", "one scene for each"],
    ),
    ("attenuation readings.csv --scene scene.toml --report readings.csv", ["readings.csv"]),
    # sweep
    ("sweep scene.toml", ["nothing is varied", "--vary PATH=RANGE"]),
    ("sweep scene.toml --vary water.absorption_per_m=0:1:3", ["-o STORE.zarr"]),
    (f"{SWEEP}", ["--vary", "PATH=RANGE"]),
    (f"{SWEEP}=0:1:0", ["impossible count", "found 0"]),
    (f"{SWEEP}=0:1:1000000000", ["impossible count"]),
    (f"{SWEEP}=-1:1:3", ["impossible value", "found -1"]),
    (f"{SWEEP}=nan", ["impossible value", "nan"]),
    (f"{SWEEP}=0:1:3:log", ["not a log range", "above 0"]),
    (f"{SWEEP}=0.1,0.1", ["stands twice"]),
    (f"{SWEEP}=0:1:3 --vary water.absorption_per_m=0,1", ["varied twice"]),
    (f"{SWEEP}=0:1:3 --rel-error 5", ["rel_error", "found 5"]),
    (f"{SWEEP}=0:1:3 --plan no.toml", ["no.toml", "check the path"]),
    ("sweep scene.toml --dry-run --plan plan.toml", ["plan.toml", "[[vary]] number 1"]),
    ("sweep scene.toml --dry-run --plan settings.toml", ["settings.toml", "rel_eror", "rel_error"]),
    ("sweep scene.toml --dry-run --plan scene.toml", ["scene.toml", "not a plan"]),
    ("sweep scene.toml --dry-run --vary tank.wall_albdo=0,1", ["did you mean tank.wall_albedo?"]),
    ("sweep open.toml --dry-run --vary tank.wall_albedo=0,0.1", ["no tank"]),
    ("sweep scene.toml --vary water.absorption_per_m=0,1 -o taken", ["taken", "something else here"]),
    ("sweep scene.toml --vary water.absorption_per_m=0,1 -o taken/s.zarr", ["taken", "cannot write here"]),
    ("sweep scene.toml --vary water.absorption_per_m=0,1 --workers -1 -o s.zarr", ["workers", "found -1"]),
    ("sweep scene.toml --vary water.absorption_per_m=0,1 --scheduler near -o s.zarr", ["near", "tcp://HOST:PORT"]),
    # show, export
    ("show", ["required: STORE"]),
    ("show no.zarr", ["no.zarr"]),
    ("show folder", ["folder", "not a sweep's store"]),
    ("show torn.zarr", ["torn.zarr"]),
    ("export no.zarr --exr out", ["no.zarr"]),
    ("export taken --exr out", ["taken"]),
    ("export folder", ["required: --exr"]),
    # demo, doctor
    ("demo --scenes folder", ["folder", "--scenes"]),
    ("demo -o taken", ["taken", "cannot write here"]),
    ("doctor now", ["now"]),
    ("doctor --threads many", ["--threads", "'many'"]),
]  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    (folder / "folder").mkdir()
    for name, content in FILES.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


@pytest.fixture
def no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong input that is found only after light was traced is found too late."""

    def started() -> None:
        pytest.fail("the backend was started")

    monkeypatch.setattr("lightfield.render.backend.choice._start", lambda backend: started())
    monkeypatch.setattr("lightfield.render.backend.choice._active", None)


def one_clear_line(message: str, words: list[str]) -> None:
    assert len(message.splitlines()) == 1, message
    assert message.startswith("lightfield: ") and "Traceback" not in message
    assert "defect of the program" not in message
    assert "remedy: " in message or "rule: " in message, message
    for word in words:
        assert word in message


@pytest.mark.parametrize(("line", "words"), WRONG, ids=[line for line, _ in WRONG])
def test_one_line_and_exit_code_2(made, no_trace, monkeypatch, capsys, line, words):
    monkeypatch.chdir(made)
    before = sorted(path for path in made.rglob("*") if path.is_file())
    assert cli.main(shlex.split(line)) == 2
    captured = capsys.readouterr()
    one_clear_line(captured.err, words)
    assert captured.out == ""
    assert sorted(path for path in made.rglob("*") if path.is_file()) == before, "a wrong input left a file"


def test_every_command_has_its_wrong_inputs():
    """The table above covers the whole program."""
    assert {line.split()[0] for line, _ in WRONG} >= set(available())
    assert len({line for line, _ in WRONG}) == len(WRONG)
