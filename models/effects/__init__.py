"""Named physical effects that a model may miss: one effect per file."""

from .effect import Action, Effect, EffectParameter, Measurements, Target

__all__ = ["Action", "Effect", "EffectParameter", "Measurements", "Target"]
