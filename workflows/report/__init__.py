"""`tolevo report`: pages built again from what directories hold."""

from __future__ import annotations

from .report import Report, report, watch

__all__ = ["Report", "report", "watch"]
