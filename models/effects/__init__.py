"""Named physical effects that a model may miss: one family per module."""

from .effect import Action, Effect, EffectParameter, Measurements, Target

__all__ = ["Action", "Effect", "EffectParameter", "Measurements", "Target"]
