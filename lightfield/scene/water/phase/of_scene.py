"""The phase function that a scene asks for."""

from __future__ import annotations

from pydantic import TypeAdapter, ValidationError

from lightfield.errors import SceneError
from lightfield.scene.water.phase import molecular, spec, tabulated
from lightfield.scene.water.phase.function import PhaseFunction
from lightfield.scene.water.phase.henyey_greenstein import HenyeyGreensteinPhase, TwoTermHenyeyGreensteinPhase


def phase_function(chosen: spec.TracedPhase) -> PhaseFunction:
    """The phase function that a scene asks for.

    Parameters
    ----------
    chosen : TracedPhase
        `water.phase` of a scene, or what it is `with_molecules`.
    """
    if isinstance(chosen, spec.WithMolecules):
        return molecular.ParticlesAndMolecules(phase_function(chosen.particles), chosen.share)
    if isinstance(chosen, spec.HenyeyGreenstein):
        return HenyeyGreensteinPhase(chosen.g)
    if isinstance(chosen, spec.TwoTermHenyeyGreenstein):
        return TwoTermHenyeyGreensteinPhase(chosen.g1, chosen.g2, chosen.alpha)
    if isinstance(chosen, spec.FournierForand):
        return tabulated.FournierForandPhase(chosen.n, chosen.mu)
    if isinstance(chosen, spec.Petzold):
        return tabulated.petzold(chosen.water)
    return tabulated.measured(chosen.file)


def with_molecules(particles: spec.PhaseSpec, share: float) -> spec.TracedPhase:
    """A scene's phase function where molecules have a share of the scattering coefficient."""
    return spec.WithMolecules(particles=particles, share=share) if share else particles


def parse_phase(text: str) -> PhaseFunction:
    """The phase function for a JSON object such as {"type": "fournier-forand", "n": 1.1, "mu": 3.5835}.

    Parameters
    ----------
    text : str
        JSON of the `phase` section of a scene.

    Raises
    ------
    SceneError
        Not a phase function.
    """
    try:
        return phase_function(TypeAdapter(spec.PhaseSpec | spec.WithMolecules).validate_json(text))
    except ValidationError as error:
        first = error.errors()[0]
        raise SceneError(
            "not a phase function", where="phase", found=text, rule=str(first["msg"]),
            remedy='write for example {"type": "henyey-greenstein", "g": 0.924}',
        ) from error  # fmt: skip
