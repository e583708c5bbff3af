"""Makes the pictures of the README from the example experiments: python tools/pictures.py (a minute)."""

from __future__ import annotations

from pathlib import Path

from lightfield.diagnosis.diagnose import diagnose
from lightfield.experiments.hide import Secret, hide
from lightfield.experiments.measure import Instrument
from lightfield.maps.dataset import to_dataset
from lightfield.render.maps import render_scene
from lightfield.report.compare.figures import maps_figure
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.style import save_png
from lightfield.scene import Scene
from lightfield.studies.compare.maps import compare

ROOT = Path(__file__).resolve().parents[1]
DPI = 80  # small files


def main() -> None:
    """Write assets/compare.png and assets/ladder.png."""
    tank = Scene.load(ROOT / "scenes/unh_tow_tank/scene.toml")
    comparison = compare(to_dataset(render_scene(tank, rel_error=0.05)))
    planes = comparison.planes[::2]
    save_png(maps_figure(planes, comparison.units, comparison.quantity), ROOT / "assets/compare.png", DPI)

    made = hide(tank, Secret(["background", "beam_tilt"]), 3, Instrument())
    found = diagnose(made.readings, made.believed).rendered()
    ladder = [rung.model_dump() for rung in found.verdict.ladder]
    save_png(ladder_figure(ladder, found.verdict.noise_floor_percent), ROOT / "assets/ladder.png", DPI)
    print(found.as_text())


if __name__ == "__main__":
    main()
