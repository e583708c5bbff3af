"""Makes scenes/unh_tow_tank/spectra.csv: readings in water and air that nobody took, of the full render.

    python tools/spectra.py

Noise of 0.35 % a reading and of 0.5 % a stay at a distance, in either medium; the render's own error is
stated with them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings, write_table
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene

FOLDER = Path(__file__).resolve().parents[1] / "scenes" / "unh_tow_tank"
#: What the water holds; `spectra.toml` does not say, for that is what the readings are to tell.
TRUTH = {"chlorophyll_mg_per_m3": 0.1, "cdom_440_per_m": 0.04, "sediment_g_per_m3": 0.05}
COLOURS, NOISE, STAY, SEED = np.arange(420.0, 681.0, 10.0), 0.0035, 0.005, 12
HEAD = {
    "source": "a full render of spectra.toml with chlorophyll 0.1 mg/m3, CDOM 0.04 per m at 440 nm and "
    "sediment 0.05 g/m3; made by tools/spectra.py, measured by nobody",
    "published_attenuation": [[500.0, 550.0, 0.1]],
}


def main() -> None:
    """Render, add noise, write."""
    truth = Scene.load(FOLDER / "spectra.toml").with_values({f"water.{k}": v for k, v in TRUTH.items()})
    distances = np.asarray(truth.detector.planes_m)
    z, colour = (v.ravel() for v in np.meshgrid(distances, COLOURS, indexing="ij"))
    wet = Readings.from_arrays(z_m=z, wavelength_nm=colour, value=np.ones(len(z)))
    light, stderr = rendered_light(truth, wet, seed=SEED, rel_error=1e-3, max_photons=4e7, symmetry=True)
    air = direct_field(truth, 0 * z, 0 * z, z, colour, np.full(len(z), "air"))
    rng = np.random.default_rng(SEED)
    stay = np.searchsorted(distances, z)
    value, own = [], []
    for clean, error in ((light, stderr / light), (air, 0 * air)):
        gain = np.exp(STAY * rng.standard_normal(len(distances))[stay])
        value.append(1e4 * clean * gain * (1 + NOISE * rng.standard_normal(len(z))))
        own.append(np.hypot(NOISE, error) * value[-1])
    table = Readings.from_arrays(
        z_m=np.tile(z, 2), wavelength_nm=np.tile(colour, 2), medium=np.repeat(["water", "air"], len(z)),
        value=np.round(np.concatenate(value), 4), stderr=np.round(np.concatenate(own), 4),
        plane_gain_percent=100 * STAY, position_mm=0.0, quantity="irradiance", metadata=HEAD,
    )  # fmt: skip
    write_table(table, FOLDER / "spectra.csv")


if __name__ == "__main__":
    main()
