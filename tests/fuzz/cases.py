"""One case: files in a folder, and a command line that reads them and does not trace."""

from __future__ import annotations

import random
import re
from pathlib import Path

from fuzz.inputs import INDEX, LOGGERS, MORE, NAMED_BY, OTHERS, OWN, PLAN, READINGS, SCENE, SPECTRA, TABLES
from fuzz.mutate import NASTY, mutated
from lightfield.scene import Scene

ASKED_OF = {
    "cast.sb": "import others.csv --quantity irradiance --units relative --band 500:550 -o out.csv",
    "ramses.dat": "import others.csv --quantity irradiance --units relative --band 500:550 -o out.csv",
    "par.dat": "import loggers.csv --quantity scalar_irradiance --units relative --band 400:700 -o out.csv",
    "table.csv": "import index.csv --quantity irradiance --units counts --band 500:550 "
    "--column wavelength_nm=1 --column value=counts -o out.csv",
}
ASKED = "import index.csv --quantity irradiance --units counts --band 500:550 -o out.csv"
PATHS = list(Scene.from_toml(SCENE).parameters())
WORDS = sorted(
    {*re.findall(r"[A-Za-z_][\w-]{2,}", " ".join((SCENE, *MORE, OWN, READINGS, PLAN, INDEX))), *PATHS}
)
#: Command lines that read the scene and, at most, readings and a plan.
COMMANDS = (
    "scene scene.toml",
    "scene scene.toml --to-toml",
    "scene scene.toml --to-xml out.xml",
    "render scene.toml -o out",
    "picture scene.toml -o out.png",
    "compare data.csv --scene scene.toml",
    "compare data.csv --scene scene.toml --with background,lamp_drift",
    "plan data.csv --scene scene.toml --no-trace",
    "range scene.toml --no-trace --readings data.csv",
    "range scene.toml --no-trace --array 3 --array-radius 1 --report out.html --json out.json",
    "band scene.toml --no-trace",
    "band scene.toml --no-trace --width 30 --report out.html --json out.json",
    "link scene.toml --water pure=0.05,0",
    "link scene.toml --water pure=0.05,0 --water murky=0.2,0 --report out.html --json out.json",
    "attenuation data.csv --scene scene.toml --no-air --no-trace",
    "attenuation data.csv --scene scene.toml --no-trace --report out.html --json out.json -o out.nc",
    "array show scene.toml --no-trace --report out.html",
    "array optimise scene.toml --no-trace --elements 5",
    "pose estimate data.csv scene.toml --no-trace --filter",
    "pose bias scene.toml --no-trace --scattering 0,0.1",
    "follow scene.toml --no-trace --runs 1 --duration 0.01",
    "follow scene.toml --no-trace --runs 2 --duration 0.01 --believe exact,relative --report out.html",
    "field export scene.toml --no-trace -o out.nc",
    "ros scene.toml --no-trace",
    "sweep scene.toml --plan plan.toml --dry-run",
    "sweep scene.toml --vary water.absorption_per_m=0:0.5:5 --dry-run",
    "hide scene.toml --effect background -o out",
    "diagnose data.csv --scene scene.toml --no-trace --no-render",
    "diagnose data.csv --scene scene.toml --effects-file own.toml --no-trace --no-render",
    "plan data.csv --scene scene.toml --effects-file own.toml --no-trace",
    "compare data.csv --scene scene.toml --effects-file own.toml --with rope",
)
OPTIONS = (
    "scene scene.toml --set {path}={nasty}",
    "scene scene.toml --set {nasty}",
    "scene scene.toml --get {path}",
    "scene scene.toml --get {nasty}",
    "sweep scene.toml --vary {path}={nasty} --dry-run",
    "sweep scene.toml --vary {path}=0:1:{nasty} --dry-run",
    "sweep scene.toml --vary {path}={nasty},1 --vary {path}=1,2 --dry-run",
    "sweep scene.toml --vary {path}=0:1:3 --rel-error {nasty} --max-photons {nasty} --seed {nasty} --dry-run",
    "sweep scene.toml --vary {path}=0:1:3 -o out.zarr --workers {nasty} --memory {nasty} --scheduler {nasty}",
    "render scene.toml --wavelengths {nasty} --rel-error {nasty} --max-photons {nasty} --seed {nasty}",
    "picture scene.toml --size {nasty} --samples {nasty} -o out.png",
    "hide scene.toml --effect {nasty} --size {path}={nasty} --strength {nasty} --noise {nasty} -o out",
    "new tank --tank {nasty} --lamp {nasty} --water {nasty} -o out",
    "new tank --tank 2x1x6 --lamp-depth {nasty} --walls {nasty} --beam {nasty} --planes {nasty} -o out",
    "new tank --lamp 525/{nasty} --power {nasty} --band {nasty} --points {nasty} --quantity {nasty} -o out",
    "hide scene.toml --layout {nasty} --plane-gain {nasty} --position {nasty} -o out",
    "import index.csv --quantity {nasty} --units {nasty} --band {nasty} --saturation-level {nasty} -o o.csv",
    "import index.csv --quantity irradiance --units counts --band {nasty}:{nasty} -o o.csv",
    "import index.csv --quantity irradiance --units counts --band 500:550 --position-mm {nasty} -o o.csv",
    "compare data.csv --scene scene.toml --with {nasty} --solver {nasty}",
    "diagnose data.csv --scene scene.toml --effects {nasty} --alpha {nasty} --seed {nasty} --no-trace",
    "range scene.toml --no-trace --share {nasty} --noise {nasty} --snr {nasty} --to {nasty}",
    "range scene.toml --no-trace --array {nasty} --array-side {nasty} --array-radius {nasty}",
    "band scene.toml --no-trace --width {nasty} --between {nasty}:{nasty} --distances {nasty},{nasty}",
    "band scene.toml --no-trace --response {nasty} --electrons {nasty} --read-noise {nasty}",
    "link scene.toml --water {nasty}={nasty},{nasty} --to {nasty} --ber {nasty} --bit-rate {nasty}",
    "link scene.toml --area {nasty} --responsivity {nasty} --amplifier-noise {nasty} --background {nasty}",
    "attenuation data.csv --scene scene.toml --no-trace --json {nasty} --report {nasty}",
    "array show scene.toml --half-width {nasty} --max-photons {nasty} --no-trace",
    "array optimise scene.toml --elements {nasty} --box {nasty} --tilt-max {nasty} --no-trace",
    "pose bias scene.toml --scattering {nasty} --half-width {nasty} --no-trace",
    "follow scene.toml --no-trace --runs {nasty} --duration 0.01 --believe {nasty} --workers {nasty}",
    "follow scene.toml --no-trace --duration {nasty} --vary {path}={nasty}",
    "field export scene.toml --no-trace -o {nasty} --half-width {nasty} --from {nasty} --to {nasty}",
    "field export scene.toml --no-trace -o out.nc --step {nasty} --max-photons {nasty}",
    "{nasty} scene.toml --threads {nasty} --backend {nasty}",
    "{command} {nasty} {nasty}",
    "{command} {option}={nasty}",
)
KINDS = ("scene", "scene", "readings", "readings", "plan", "index", "spectrum", "table", "own", "options")
#: The file that is damaged in a case of that kind; of spectra and tables any.
DAMAGED = {
    "scene": "scene.toml",
    "readings": "data.csv",
    "plan": "plan.toml",
    "index": "index.csv",
    "own": "own.toml",
    "options": "scene.toml",
}
OPTION_NAMES = re.findall(r"--[a-z-]+", " ".join((*COMMANDS, *OPTIONS)))


def make_case(seed: int, number: int, folder: Path) -> list[str]:
    """Write the files of one case, and give its command line."""
    rng = random.Random(f"{seed}:{number}")
    files = {
        "scene.toml": SCENE,
        "data.csv": READINGS,
        "plan.toml": PLAN,
        "index.csv": INDEX,
        "own.toml": OWN,
        "others.csv": OTHERS,
        "loggers.csv": LOGGERS,
    }
    files |= {**SPECTRA, **TABLES}
    kind = rng.choice(KINDS)
    damaged = DAMAGED.get(kind) or rng.choice([*(SPECTRA if kind == "spectrum" else TABLES)])
    if kind == "scene" and rng.random() < 0.5:
        files["scene.toml"] = _joined(SCENE, rng.sample(MORE, rng.randint(1, 3)))
    if kind == "table":
        files["scene.toml"] = NAMED_BY[damaged] + "[detector]\nplanes_m = [4.5]\npixels = 5\n"
    for name, text in files.items():
        if kind != "options" and name == damaged:
            (folder / name).write_bytes(mutated(text, WORDS, rng))
        else:
            (folder / name).write_text(text, encoding="utf-8")
    if kind == "options":
        return [_filled(word, rng) for word in rng.choice(OPTIONS).split()]
    if kind in ("index", "spectrum"):
        return ASKED_OF.get(damaged, ASKED).split()
    return rng.choice([line for line in COMMANDS if damaged in line or kind == "table"]).split()


def _filled(word: str, rng: random.Random) -> str:
    """Every blank of a word filled in, each anew."""
    while found := re.search(r"\{(path|nasty|option|command)\}", word):
        choices = {"path": PATHS, "nasty": NASTY, "option": OPTION_NAMES, "command": _COMMAND_NAMES}[found[1]]
        word = word[: found.start()] + rng.choice(choices).replace("{", "(") + word[found.end() :]
    return word


_COMMAND_NAMES = sorted({line.split()[0] for line in COMMANDS} | {"import", "show", "export", "diagnose"})


def _joined(scene: str, parts: list[str]) -> str:
    """A scene with what other parts say put into its tables."""
    for part in parts:
        head, *lines = part.split("\n")
        for line in lines:
            key = line.split(" = ")[0]
            scene = re.sub(rf"(?m)^{key} = .*\n", "", scene)
            scene = scene.replace(f"{head}\n", f"{head}\n{line}\n")
    return scene
