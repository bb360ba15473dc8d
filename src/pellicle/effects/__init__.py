"""The effects a scene may call for, and how each is judged."""

from pellicle.effects import averaging, presence
from pellicle.effects.row import Effect, Row

EFFECTS = (
    Effect("absorption", presence.absorption),
    Effect("stack", presence.stack),
    Effect("roughness", presence.roughness),
    Effect("tunnelling", presence.tunnelling),
    Effect("oblique", presence.oblique),
    Effect("polarisation", presence.polarisation),
    Effect("transmission", presence.transmission),
    Effect("back-face", presence.back_face),
    Effect("coherence", averaging.coherence),
    Effect("orders", averaging.orders),
    Effect("angle-spread", averaging.angle_spread),
    Effect("dispersion", presence.dispersion),
    Effect("opaque", presence.opaque),
    Effect("precision", presence.precision),
)
"""Every effect there is, in the order that a plan lists them."""

__all__ = ["EFFECTS", "Effect", "Row"]
