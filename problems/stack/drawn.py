"""What a drawing states of a part in addition to its limits: class, symbol, numbers."""

from __future__ import annotations

import math

from scipy.special import ndtr

from ...models.iso286 import SYMBOLS, Fit
from .definition import Part, Requirement


def drawn(part: Part) -> dict[str, str]:
    """Tolerance class or grade as stated, symbol of the geometrical characteristic (ISO 1101) with
    its name, numbers of drawing and characteristic, capability and mean of its process; what is not
    stated is left out.
    """
    labels = {"class": _class(part), "drawing": part.drawing, "characteristic": part.characteristic}
    if part.geometry:
        labels["symbol"] = f"{SYMBOLS[part.geometry]} {part.geometry.replace('_', ' ')}"
    capability = part.stated.get("cpk") or getattr(part.distribution, "cp", None)
    if part.one_sided:
        capability, labels["inspection"] = _at_one_limit(part)
    elif part.distribution.one_sided and isinstance(capability, int | float):
        labels["inspection"] = f"at most {100.0 * ndtr(-3.0 * capability):.3g} % of the parts beyond the limit"
    elif part.sample is not None and part.sample.offset:
        labels["mean"] = f"mean {part.sample.offset:+.3g} {part.unit} from the mid-limit, as measured"
    if isinstance(capability, int | float):
        labels["cpk"] = f"{capability:g}"
    return {key: value for key, value in labels.items() if value}


def _at_one_limit(part: Part) -> tuple[float, str]:
    """Cpk of a part with one limit, and what the model assumes of its process: it has no Cp."""
    m1, m2 = part.distribution.raw_moments(2)[1:]
    std, mean = part.high * math.sqrt(m2 - m1**2), part.mean + part.high * m1
    if part.sample is not None and "Cpk" in part.sample.indices:
        cpk = part.sample.indices["Cpk"].value
    else:
        cpk = (part.high + part.natural * (mean - part.mid)) / (3.0 * std)
    return cpk, f"standard deviation {std:.3g} {part.unit}, mean {mean:+.3g} {part.unit} from the nominal, one limit"


def labels_of(requirement: Requirement) -> dict[str, object]:
    """Labels of a requirement for readers: name, limits and their unit, description, drawing."""
    labels = {key: getattr(requirement, key) for key in ("name", "lower", "upper", "unit", "description", "drawing")}
    return {key: value for key, value in labels.items() if value not in (None, "")}


def _class(part: Part) -> str:
    """Like g6 of a fit, IT6 of a fixed grade, ISO 2768-m of a general tolerance."""
    fit, grade, general = (part.stated.get(key) for key in ("fit", "grade", "general"))
    if isinstance(fit, str):
        return str(Fit.of_text(fit))
    if isinstance(general, str):
        return f"ISO 2768-{general.removeprefix('ISO 2768-').removeprefix('ISO 2768').strip()}"
    return grade.strip() if isinstance(grade, str) else ""
