"""What a scene file may say about the phase function; the functions themselves stand beside it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from lightfield.scene.acts import Acts
from lightfield.scene.parameters import Part, TablePath, number
from lightfield.storage.tables import read_columns, readable


class HenyeyGreenstein(Part):
    """Henyey-Greenstein (1941): one parameter, the mean cosine."""

    type: Literal["henyey-greenstein"] = "henyey-greenstein"
    g: float = number(0.924, "1", "mean cosine of the scattering angle", Acts.PHASE, above=-1.0, below=1.0)


class TwoTermHenyeyGreenstein(Part):
    """alpha HG(g1) + (1 - alpha) HG(g2); g2 is negative for a backward lobe."""

    type: Literal["two-term-hg"] = "two-term-hg"
    g1: float = number(0.9305, "1", "mean cosine of the first term", Acts.PHASE, above=-1.0, below=1.0)
    g2: float = number(-0.502, "1", "mean cosine of the second term", Acts.PHASE, above=-1.0, below=1.0)
    alpha: float = number(0.9967, "1", "weight of the first term", Acts.PHASE, low=0.0, high=1.0)


class FournierForand(Part):
    """Fournier and Forand (1994), in the 1999 form: Junge-distributed spheres."""

    type: Literal["fournier-forand"] = "fournier-forand"
    n: float = number(
        1.10, "1", "refractive index of the particles relative to water", Acts.PHASE, above=1.0, high=1.5
    )
    mu: float = number(3.5835, "1", "slope of the Junge size distribution", Acts.PHASE, above=3.0, below=5.0)


class Petzold(Part):
    """Measured by Petzold (1972): the average particle, or one of his three waters."""

    type: Literal["petzold"] = "petzold"
    water: Literal["average", "clear", "coastal", "harbor"] = Field(
        "average", description="average particle (Mobley et al. 1993), AUTEC 8, HAOCE 11 or NUC 2040"
    )


class MeasuredPhase(Part):
    """Your own table: CSV with columns angle_deg and phase_per_sr (any scale, it is normalised)."""

    type: Literal["table"] = "table"
    file: TablePath = Field(description="CSV file, columns angle_deg and phase_per_sr")

    @model_validator(mode="after")
    def _file_is_readable(self) -> MeasuredPhase:
        readable(read_columns, self.file, ("angle_deg", "phase_per_sr"))
        return self


class WithMolecules(Part):
    """Particles, and molecules for a share of the scattering: what a base of pure water adds."""

    type: Literal["with-molecules"] = "with-molecules"
    particles: Annotated[
        HenyeyGreenstein | TwoTermHenyeyGreenstein | FournierForand | Petzold | MeasuredPhase,
        Field(discriminator="type"),
    ]
    share: float = Field(ge=0.0, le=1.0)


PhaseSpec = Annotated[
    HenyeyGreenstein | TwoTermHenyeyGreenstein | FournierForand | Petzold | MeasuredPhase,
    Field(discriminator="type"),
]
#: What light is turned by: as a scene says, or with the molecules of its water.
TracedPhase = (
    HenyeyGreenstein | TwoTermHenyeyGreenstein | FournierForand | Petzold | MeasuredPhase | WithMolecules
)
