"""What readings in water against readings in air tell of the water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import Apparent, apparent_attenuation
from lightfield.studies.attenuation.ratios import ratios_of, same_water


@dataclass(frozen=True, eq=False)
class Attenuation:
    """The answer.

    Parameters
    ----------
    apparent : tuple of Apparent
        One per table.
    """

    apparent: tuple[Apparent, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed or left out, each once."""
        return tuple(dict.fromkeys(note for one in self.apparent for note in one.ratios.notes))


def attenuation(
    readings: Readings | Sequence[Readings], scenes: Scene | Sequence[Scene], in_air: bool | None = None
) -> Attenuation:
    """Attenuation of the water from one table of readings, or from several of the same water.

    Parameters
    ----------
    readings : Readings, or several
        Several receivers (each a table with its scene) part absorption from scattering.
    scenes : Scene, or several
        One for each table, or one for all. Lamp, tank and receiver count; the water is looked for.
    in_air : bool, optional
        Divide by readings in air; default: where there are any.

    Raises
    ------
    MeasurementError
        Too few distances; tables of different wavelengths; not one scene for each.
    """
    tables = [readings] if isinstance(readings, Readings) else list(readings)
    given = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if len(given) == 1:
        given *= len(tables)
    if not tables or len(given) != len(tables):
        raise MeasurementError(
            "tables and scenes do not belong together",
            found=f"{len(tables)} tables, {len(given)} scenes",
            rule="one scene for each table, in the same order, or one for all",
            remedy="name the scene of each receiver",
        )
    ratios = [ratios_of(table, scene, in_air) for table, scene in zip(tables, given, strict=True)]
    same_water(ratios)
    return Attenuation(tuple(apparent_attenuation(r) for r in ratios))
